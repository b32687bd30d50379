"""What the answers in lockstep mean, by their times: checks where the test asks for them, else a note."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from dodo_dsl.margins import with_margin
from dodo_dsl.outcome import SAMPLE_TIMES, SLOW_ANSWERS, Response
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.outcomes import Finding

UNSEEN = "the limit of the time of an answer is not judged, as what containers wait for a processor cannot be seen"
MOST_SLOW = 0.1
"""Share of answers that may take longer than the frames' period before a note says so."""
MOST_PERIODS = 10
"""The periods of frames that one answer may take before a note says so."""

_Judged = tuple[str, dict[str, Any]]
"""Why the application failed, or an empty text; and the check."""


@dataclass(frozen=True)
class JudgedFigures:
    """What follows from what was measured of the application."""

    findings: tuple[Finding, ...] = ()
    checks: tuple[dict[str, Any], ...] = ()
    notes: tuple[str, ...] = ()


def judged(response: Response | None, lockstep: Lockstep | None, services: Sequence[str]) -> JudgedFigures:
    """Judges the answers by the limits of the test; ``services`` are the application's."""
    if response is None or lockstep is None:
        return JudgedFigures()
    every = [*_times(response, lockstep), *_copies(response, lockstep)]
    who = services[0] if services else ""
    findings = tuple(Finding("failed", reason, who) for reason, _ in every if reason)
    return JudgedFigures(findings, tuple(with_margin(check) for _, check in every), tuple(_notes(response, lockstep)))


def _times(response: Response, lockstep: Lockstep) -> Iterator[_Judged]:
    if lockstep.max_response_s is None or response.over is None:
        return
    share, allowed = response.over / response.answers, lockstep.response_over
    if response.processor_median_s is None:  # what a busy machine kept from the application is among these times
        return
    limit = f"{lockstep.max_response_s * 1000:g} ms (at most {allowed * 100:g} %)"
    reason = f"{response.over} of {response.answers} answers took longer than {limit}: {response.in_words()}"
    ok = share <= allowed
    yield "" if ok else reason, {"name": SLOW_ANSWERS, "value": share, "limit": {"max": allowed}, "unit": "", "ok": ok}


def _copies(response: Response, lockstep: Lockstep) -> Iterator[_Judged]:
    if not lockstep.is_copied:
        return
    reason = f"{response.uncopied} of {response.answers} answers did not carry the sample time of their frame"
    ok = response.uncopied == 0
    check = {"name": SAMPLE_TIMES, "value": response.uncopied, "limit": {"max": 0}, "unit": "", "ok": ok}
    yield "" if ok else reason, check


def _notes(response: Response, lockstep: Lockstep) -> Iterator[str]:
    if response.slow > MOST_SLOW * response.answers:
        slow = f"{response.slow} of {response.answers} answers took longer than the frames' period"
        yield f"too slow for real time: {slow} of {response.period_s * 1000:g} ms; {response.in_words()}"
    if response.worst_s > MOST_PERIODS * response.period_s:
        which = f" to frame {response.worst_frame}" if response.worst_frame else ""
        waits = " with what it waited for a processor" if response.processor_median_s is None else ""
        frames = f"{response.worst_s / response.period_s:.0f} frames, which outside lockstep would not have waited"
        yield f"the answer{which} took {response.worst_s:.3g} s{waits}, as long as {frames}"
    is_unseen = response.processor_median_s is None and response.over is not None
    if is_unseen and (response.over or 0) > lockstep.response_over * response.answers:
        yield UNSEEN
