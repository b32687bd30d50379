"""``dodo compile --forecast``: how long the pipeline will take, in words."""

from collections.abc import Callable, Sequence
from pathlib import Path

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.emit.forecast import forecast
from dodo_dsl.emit.job_options import JobOptions, Seconds
from dodo_dsl.emit.pipeline import pipeline
from dodo_dsl.plan.model import Plan, Suite
from dodo_dsl.plan.pools import by_test
from dodo_dsl.report import results


def forecast_text(suite: Suite, runners: int, options: JobOptions, overhead: float) -> str:
    """One line, and a second one for tests of which no time is known; raises UsageError for reports that are none.

    ``overhead`` are seconds from when GitLab gives a job to a runner until its test begins, and at its end.
    """
    known = dict(options.seconds(by_test(suite.plans)))
    timeouts = {plan.slug: plan.timeout_s for plan in by_test(suite.plans)}
    unknown = [slug for slug in timeouts if slug not in known]
    found = forecast(pipeline(suite, "", (), options), (timeouts | known).__getitem__, runners, overhead)
    who = f"{runners} runner{'s' if runners > 1 else ''}"
    line = f"forecast with {who}: {'at most' if unknown else 'about'} {_duration(found.seconds)}"
    parts = [f"{_duration(found.work)} of work", f"{overhead:g} s a job before its test", f"{found.last} ends last"]
    return f"{line} ({', '.join(parts)})\n{_without(unknown)}"


def packing_text(suite: Suite, options: JobOptions) -> str:
    """How many jobs share the tests, and how long the tests of the longest take if they run one after the other."""
    known, jobs = options.seconds(by_test(suite.plans)), pipeline(suite, "", (), options).jobs
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
