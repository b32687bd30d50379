"""Forecasts in words: how long a pipeline (``dodo compile --forecast``) or a run on this machine will take.

A run's is from the history of this machine: how many tests run at a time, and how long.
"""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

from dodo_dsl.cli import progress
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.emit.pipeline import Pipeline, forecast
from dodo_dsl.emit.pipeline_jobs import Seconds
from dodo_dsl.plan.model import Plan, Suite
from dodo_dsl.plan.runs import by_test
from dodo_dsl.report import results
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History
from dodo_dsl.run.schedule import Schedule


def forecast_text(suite: Suite, child: Pipeline, runners: int, overhead: float) -> str:
    """One line, and a second one for tests of which no time is known; raises UsageError for reports that are none.

    ``overhead`` are seconds from when GitLab gives a job to a runner until its test begins, and at its end.
    """
    known = dict(child.options.seconds(by_test(suite.plans)))
    timeouts = {plan.slug: plan.timeout_s for plan in by_test(suite.plans)}
    unknown = [slug for slug in timeouts if slug not in known]
    found = forecast(child, (timeouts | known).__getitem__, runners, overhead)
    who = f"{runners} runner{'s' if runners > 1 else ''}"
    line = f"forecast with {who}: {'at most' if unknown else 'about'} {_duration(found.seconds)}"
    parts = [f"{_duration(found.work)} of work", f"{overhead:g} s a job before its test", f"{found.last} ends last"]
    return f"{line} ({', '.join(parts)})\n{_without(unknown)}"


def packing_text(suite: Suite, child: Pipeline) -> str:
    """How many jobs share the tests, and how long the tests of the longest take if they run one after the other."""
    known, jobs = child.options.seconds(by_test(suite.plans)), child.jobs
    took = {plan.slug: known.get(plan.slug, plan.timeout_s) for plan in by_test(suite.plans)}
    unknown = [slug for slug in took if slug not in known]
    seconds, longest = max((sum(map(took.__getitem__, job.tests)), job.name) for job in jobs)
    size = f"{'at most' if unknown else 'about'} {_duration(seconds)}"
    return f"packed into {len(jobs)} job{'s' if len(jobs) > 1 else ''}, {size} in '{longest}'\n{_without(unknown)}"


def known_seconds(times: Sequence[Path]) -> Seconds:
    """From reports, else from the history of this machine; raises UsageError for a report that is none."""
    if not times:
        return _from_history
    known = _from_results(times)
    return lambda _plans: known


def _without(unknown: Sequence[str]) -> str:
    if not unknown:
        return ""
    others = f" and {len(unknown) - 1} more" if len(unknown) > 1 else ""
    return f"note: {unknown[0]}{others} never ran here, and may take the whole timeout; --times takes results\n"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _from_history(plans: Sequence[Plan]) -> dict[str, float]:
    """The median of the latest runs on this machine, by slug."""
    from dodo_dsl.run.history import History
    from dodo_dsl.run.runner import default_backend

    history, backend = History(), default_backend(plans)
    took: Callable[[Plan], float | None] = lambda p: history.seconds(p.spec, p.slug, backend, p.clock)  # noqa: E731
    return {plan.slug: seconds for plan in plans if (seconds := took(plan)) is not None}


def _from_results(times: Sequence[Path]) -> dict[str, float]:
    """Set-up and execution by slug; a later file replaces what an earlier one says."""
    known = {}
    for path in times:
        try:
            outcomes = results.load(path / results.FILE_NAME if path.is_dir() else path)
        except results.ResultsError as error:
            raise UsageError(str(error)) from error
        for outcome in outcomes:
            if outcome.setup_s is not None and outcome.execution_s is not None:
                known[outcome.slug] = outcome.setup_s + outcome.execution_s
    return known


def at_once(order: Schedule, jobs: Sequence[Job]) -> str:
    """How many tests run at a time, in words."""
    least = max(min(order.need(job) for job in jobs), 0.01)
    most = min(1 + int((order.capacity - max(least, order.setup)) / least), len(jobs))
    return f"{'up to ' * (len(jobs) > 1)}{max(most, 1)} at a time"


def run_forecast(order: Schedule, jobs: Sequence[Job], backend: str) -> str:
    """How long the run will take, in words; a test without history may take its whole timeout."""
    history = History()
    known = all(history.seconds(j.plan.spec, j.test, backend, j.plan.clock) is not None for j in jobs)
    seconds = order.forecast(order.ordered(jobs))
    return progress.about(seconds) if known else progress.about(seconds).replace("about", "at most")


def usage(backend: str) -> Callable[[Job], float | None]:
    """How many cores a job used according to the history."""
    history = History()

    @functools.cache
    def known(spec: str, test: str, clock: str) -> float | None:
        return history.cores(spec, test, backend, clock)

    return lambda job: known(job.plan.spec, job.test, job.plan.clock)


def expectation(backend: str) -> Callable[[Job], float]:
    """How long a job takes according to the history; an unknown one may take its whole timeout."""
    history = History()

    @functools.cache
    def known(spec: str, test: str, clock: str) -> float | None:
        return history.seconds(spec, test, backend, clock)

    def expected(job: Job) -> float:
        seconds = known(job.plan.spec, job.test, job.plan.clock)
        return job.plan.timeout_s if seconds is None else seconds

    return expected
