"""Forecasts in words: how long the longest job of a pipeline (``dodo compile --jobs``) or a run will take.

A run's is from the history of this machine: how many tests run at a time, and how long.
"""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

from dodo_dsl.cli import progress
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.emit.pipeline import Pipeline
from dodo_dsl.plan.model import Suite
from dodo_dsl.plan.runs import by_test
from dodo_dsl.report import results
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History
from dodo_dsl.run.schedule import Schedule


def packing_text(suite: Suite, child: Pipeline) -> str:
    """How many jobs share the tests, and how long the tests of the longest take if they run one after the other."""
    known, jobs = child.options.seconds, child.jobs
    took = {plan.slug: known.get(plan.slug, plan.timeout_s) for plan in by_test(suite.plans)}
    unknown = [slug for slug in took if slug not in known]
    seconds, longest = max((sum(map(took.__getitem__, job.tests)), job.name) for job in jobs)
    size = f"{'at most' if unknown else 'about'} {_duration(seconds)}"
    return f"packed into {len(jobs)} job{'s' if len(jobs) > 1 else ''}, {size} in '{longest}'\n{_without(unknown)}"


def _without(unknown: Sequence[str]) -> str:
    if not unknown:
        return ""
    others = f" and {len(unknown) - 1} more" if len(unknown) > 1 else ""
    return f"note: {unknown[0]}{others} may take the whole timeout; --times takes results\n"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def known_seconds(times: Sequence[Path]) -> dict[str, float]:
    """Set-up and execution by slug; a later file replaces what an earlier one says. Raises UsageError for no report."""
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
    most = min(order.capacity // min(order.need(job) for job in jobs), len(jobs))
    return f"{'up to ' * (len(jobs) > 1)}{max(most, 1)} at a time"


def run_forecast(order: Schedule, jobs: Sequence[Job], backend: str) -> str:
    """How long the run will take, in words; a test without history may take its whole timeout."""
    history = History()
    known = all(history.seconds(j.plan.spec, j.test, backend, j.plan.clock) is not None for j in jobs)
    seconds = order.forecast(order.ordered(jobs))
    return progress.about(seconds) if known else progress.about(seconds).replace("about", "at most")


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
