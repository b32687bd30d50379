"""``dodo compile --forecast``: how long the pipeline will take, in words."""

from collections.abc import Callable, Sequence
from pathlib import Path

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.emit.forecast import forecast
from dodo_dsl.emit.pipeline import pipeline
from dodo_dsl.plan.model import Plan, Suite
from dodo_dsl.report import results


def forecast_text(suite: Suite, runners: int, times: Sequence[Path], overhead: float) -> str:
    """One line, and a second one for tests of which no time is known; raises UsageError for ``times``.

    ``overhead`` are seconds from when GitLab gives a job to a runner until its test begins, and at its end.
    """
    known = _from_results(times) if times else _from_history(suite.plans)
    timeouts = {plan.slug: plan.timeout_s for plan in suite.plans}
    unknown = [slug for slug in timeouts if slug not in known]
    found = forecast(pipeline(suite, ""), (timeouts | known).__getitem__, runners, overhead)
    who = f"{runners} runner{'s' if runners > 1 else ''}"
    line = f"forecast with {who}: {'at most' if unknown else 'about'} {_duration(found.seconds)}"
    parts = [f"{_duration(found.work)} of work", f"{overhead:g} s a job before its test", f"{found.last} ends last"]
    return f"{line} ({', '.join(parts)})\n{_without(unknown)}"


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
