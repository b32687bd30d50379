"""What measured load means: a machine too busy for a verdict, or an application that is slow or takes too much.

A test in real time on a machine that was too busy ends in error. Answers in lockstep, by their times, and the
application's use of processors and memory become checks where the test asks for them, else notes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dodo_dsl.outcome import (
    PEAK_MEMORY,
    PROCESSOR_SHARE,
    PROCESSOR_TIME,
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    Check,
    MachineLoad,
    Response,
    ServiceUse,
    with_margin,
)
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.outcomes import Finding
from dodo_dsl.spec.model import ResourceLimits

MOST_WAITED = 0.1
"""Share of the test's time that a service may have waited for a processor."""
LEAST_WAITED_S = 0.25
"""Seconds that a service may have waited in any case: a test that ends at once is not decided by a tenth of it."""
MOST_LATE = 0.1
"""Share of the pictures, or of a service's other updates, that may have come later than half a period."""
LEAST_CROWDED = 0.1
"""Share of the test's time in which others must have filled the machine for lateness to be their fault."""
_MAX_FOUND = 300
_WAY_OUT = "run it with --clock lockstep, or fewer tests at once (-j 1)"


def consider(finding: Finding, load: MachineLoad | None) -> tuple[Finding, MachineLoad | None]:
    """An error in place of a failure that may be due to a busy machine; anything else as it is. The load says so, too.

    Only findings that depend on time can turn (docs/decisions/0007). An emulated rig that stood still is not a rig,
    whatever else was measured.
    """
    if load is None or finding.result != "failed" or finding.cause != "verdict" or not (why := too_busy(load)):
        return finding, load
    found = finding.reason if len(finding.reason) <= _MAX_FOUND else f"{finding.reason[:_MAX_FOUND]}..."
    reason = f"the machine was too busy to judge: {why}; it found: {found}; {_WAY_OUT}"
    return replace(finding, result="error", reason=reason), replace(load, undecided=True)


def too_busy(load: MachineLoad) -> str:
    """How the machine hindered the test, in words; empty when it did not, or that was not measured."""
    if load.paused_s > 0:
        return f"the emulated rig could not keep real time and stood still for {load.paused_s:.2f} s"
    if load.application is None or load.services is None or load.crowded_s is None or load.cores is None:
        return ""
    own = load.services.ran_s / (load.cores * load.duration_s)
    share = f"{min((load.others_share or 0.0) + own, 1.0) * 100:.0f} %"
    wait = load.application
    if wait.displaced_s > max(MOST_WAITED * load.duration_s, LEAST_WAITED_S):
        waited = f"{wait.displaced_s:.1f} s of {load.duration_s:.1f} s"
        return f"{wait.longest} waited {waited} for a processor, others took {share} of it"
    if load.crowded_s > LEAST_CROWDED * load.duration_s:
        for late, what in (
            (load.late_pictures_share, "the pictures"),
            (load.late_updates_share, "the updates of one of DoDo's services"),
        ):
            if late > MOST_LATE:
                found = f"{late * 100:.0f} % of {what} came late, by up to {load.lateness_s:.2f} s"
                return f"{found}, others took {share} of the processor"
    return ""


UNMEASURED = "the limit of the time of an answer is not judged, as nothing was measured"
UNSEEN_USE = (
    "the limits of processor time and memory are not judged, because what the application uses cannot be measured here"
)
MOST_SLOW = 0.1
"""Share of answers that may take longer than the frames' period before a note says so."""
_MB = 1e6


@dataclass(frozen=True)
class JudgedFigures:
    """What follows from what was measured of the application."""

    findings: tuple[Finding, ...] = ()
    checks: tuple[Check, ...] = ()
    notes: tuple[str, ...] = ()

    def judged(
        self, name: str, value: float, most: float, reason: str, service: str, unit: str = "", digits: int | None = None
    ) -> "JudgedFigures":
        """With a check of a value, which is shown with some digits, and with a finding if it is above the limit."""
        shown = value if digits is None else round(value, digits)
        check = {"name": name, "value": shown, "limit": {"max": most}, "unit": unit, "ok": value <= most}
        findings = () if value <= most else (Finding("failed", reason, service),)
        return replace(self, findings=self.findings + findings, checks=(*self.checks, with_margin(check)))

    def noted(self, *notes: str) -> "JudgedFigures":
        return replace(self, notes=(*self.notes, *filter(None, notes)))


def judged_response(response: Response | None, lockstep: Lockstep | None, services: Sequence[str]) -> JudgedFigures:
    """Judges what answers took by the limits of the test; ``services`` are the application's."""
    judged, who = JudgedFigures(), services[0] if services else ""
    if lockstep is None:
        return judged
    if response is None:
        return judged.noted("" if lockstep.max_response_s is None else UNMEASURED)
    answers, over, allowed = response.answers, response.over, lockstep.response_over
    if lockstep.max_response_s is not None and over is not None:
        limit = f"{lockstep.max_response_s * 1000:g} ms (at most {allowed * 100:g} %)"
        reason = f"{over} of {answers} answers took longer than {limit}: {response.in_words()}"
        judged = judged.judged(SLOW_ANSWERS, over / answers, allowed, reason, who)
    if lockstep.is_copied:
        reason = f"{response.uncopied} of {answers} answers did not carry the sample time of their frame"
        judged = judged.judged(SAMPLE_TIMES, response.uncopied, 0, reason, who)
    return judged.noted(_slowness(response))


def _slowness(response: Response) -> str:
    if response.slow <= MOST_SLOW * response.answers:
        return ""
    slow = f"{response.slow} of {response.answers} answers took longer than the frames' period"
    return f"too slow for real time: {slow} of {response.period_s * 1000:g} ms; {response.in_words()}"


def judged_use(uses: Sequence[ServiceUse], limits: ResourceLimits | None) -> JudgedFigures:
    """Judges what each service used by the limits of the test."""
    judged = JudgedFigures()
    if limits is None:
        return judged
    for use in uses:
        for name, value, most, unit, words in (
            (PEAK_MEMORY, use.peak_memory_bytes / _MB, limits.max_memory_mb, "MB", "used {:,.4g} MB of memory"),
            (PROCESSOR_TIME, use.processor_s, limits.max_processor_time_s, "s", "took {:.2f} s of processor time"),
            (PROCESSOR_SHARE, use.processor_share, limits.max_processor_share, "", "took {:.0f} % of a processor"),
        ):
            if most is None:
                continue
            if value is None:
                short = "is not judged: the test was too short to measure it"
                judged = judged.noted(f"{name} of service '{use.service}' {short}")
                continue
            at_most = f"at most {most:,.6g} {unit}" if unit else f"at most {most * 100:g} %"
            reason = f"application service '{use.service}' {words.format(value if unit else 100 * value)}, {at_most}"
            judged = judged.judged(f"{name}-{use.service}", value, most, reason, use.service, unit, digits=3)
    return judged.noted("" if uses else UNSEEN_USE)
