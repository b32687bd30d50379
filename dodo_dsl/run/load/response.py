"""What the times of answers in lockstep mean: a check where the test sets a limit, else a note."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dodo_dsl.outcome import Response
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.outcomes import Finding

CHECK = "slow-answers"
"""The check of a test's limit; its value differs from run to run, unlike all others of lockstep."""
UNSEEN = "the limit of the time of an answer is not judged, as what containers wait for a processor cannot be seen"
MOST_SLOW = 0.1
"""Share of answers that may take longer than the frames' period before a note says so."""


@dataclass(frozen=True)
class JudgedResponse:
    """What follows from the times of answers."""

    findings: tuple[Finding, ...] = ()
    checks: tuple[dict[str, Any], ...] = ()
    notes: tuple[str, ...] = ()


def judged(response: Response | None, lockstep: Lockstep | None, services: Sequence[str]) -> JudgedResponse:
    """Judges the times of answers by the limit of the test; ``services`` are the application's."""
    if response is None or lockstep is None:
        return JudgedResponse()
    notes = (_note(response),) if response.slow > MOST_SLOW * response.answers else ()
    if lockstep.max_response_s is None or response.over is None:
        return JudgedResponse(notes=notes)
    share, allowed = response.over / response.answers, lockstep.response_over
    if response.processor_median_s is None:  # what a busy machine kept from the application is among these times
        return JudgedResponse(notes=(*notes, UNSEEN) if share > allowed else notes)
    check = {"name": CHECK, "value": share, "limit": {"max": allowed}, "unit": "", "ok": share <= allowed}
    if share <= allowed:
        return JudgedResponse(checks=(check,), notes=notes)
    limit = f"{lockstep.max_response_s * 1000:g} ms (at most {allowed * 100:g} %)"
    reason = f"{response.over} of {response.answers} answers took longer than {limit}: {response.in_words()}"
    return JudgedResponse((Finding("failed", reason, services[0] if services else ""),), (check,), notes)


def _note(response: Response) -> str:
    slow = f"{response.slow} of {response.answers} answers took longer than the frames' period"
    return f"too slow for real time: {slow} of {response.period_s * 1000:g} ms; {response.in_words()}"
