"""What measured load means: a machine too busy for a verdict, or an application that is slow or takes too much."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
from dodo_dsl.run.protocol import Finding
from dodo_dsl.spec.model import ResourceLimits

MOST_WAITED = 0.1
"""Share of the test's time that a service may have waited for a processor."""
LEAST_WAITED_S = 0.25
"""Seconds that a service may have waited in any case: a test that ends at once is not decided by a tenth of it."""
MOST_LATE = 0.1
"""Share of the pictures, or of a service's other updates, that may have come later than half a period."""
LEAST_CROWDED = 0.1
"""Share of the test's time in which others must have filled the machine for lateness to be their fault."""
_WAY_OUT = "run it with --clock lockstep, or fewer tests at once (-j 1)"


def consider(finding: Finding, load: MachineLoad | None) -> tuple[Finding, MachineLoad | None]:
    """An error in place of a failure that may be due to a busy machine; anything else as it is. The load says so, too.

    Only findings that depend on time can turn (docs/decisions/0007). An emulated rig that stood still is not a rig,
    whatever else was measured.
    """
    if load is None or finding.result != "failed" or finding.cause != "verdict" or not (why := too_busy(load)):
        return finding, load
    reason = f"the machine was too busy to judge: {why}; it found: {finding.reason}; {_WAY_OUT}"
    return replace(finding, result="error", reason=reason), replace(load, undecided=True)


def too_busy(load: MachineLoad) -> str:
    """How the machine hindered the test, in words; empty when it did not, or that was not measured."""
    if load.paused_s > 0:
        return f"the emulated rig could not keep real time and stood still for {load.paused_s:.2f} s"
    if load.application is None or load.services is None or load.crowded_s is None or load.cores is None:
        return ""
    own = load.services.ran_s / (load.cores * load.duration_s)
    others = f"others took {min((load.others_share or 0.0) + own, 1.0) * 100:.0f} % of the processor"
    wait = load.application
    if wait.displaced_s > max(MOST_WAITED * load.duration_s, LEAST_WAITED_S):
        return f"{wait.longest} waited {wait.displaced_s:.1f} s of {load.duration_s:.1f} s for a processor, {others}"
    late, what = max(
        (load.late_pictures_share, "the pictures"),
        (load.late_updates_share, "the updates of one of DoDo's services"),
    )
    if late > MOST_LATE and load.crowded_s > LEAST_CROWDED * load.duration_s:
        return f"{late * 100:.0f} % of {what} came late, by up to {load.lateness_s:.2f} s, {others}"
    return ""


UNMEASURED = "the limit of the time of an answer is not judged, as nothing was measured"
UNSEEN_USE = (
    "the limits of processor time and memory are not judged, because what the application uses cannot be measured here"
)
MOST_SLOW = 0.1
"""Share of answers that may take longer than the frames' period before a note says so."""


@dataclass
class JudgedFigures:
    """What follows from what was measured of the application: checks where the test asks for them, else notes."""

    findings: list[Finding] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def _judge(self, name: str, values: tuple[float, float], most: float, reason: str, who: str, unit: str) -> None:
        """Adds a check of a value, shown as the second of ``values``, and a finding if it is above ``most``."""
        value, shown = values
        check = {"name": name, "value": shown, "limit": {"max": most}, "unit": unit, "ok": value <= most}
        self.checks.append(with_margin(check))
        if value > most:
            self.findings.append(Finding("failed", reason, who))

    def judge_answers(self, response: Response | None, lockstep: Lockstep | None, services: Sequence[str]) -> None:
        """Judges what answers took by the limits of the test; ``services`` are the application's."""
        if lockstep is None or response is None:
            if lockstep and lockstep.max_response_s is not None:
                self.notes.append(UNMEASURED)
            return
        answers, over, who = response.answers, response.over, services[0] if services else ""
        if lockstep.max_response_s is not None and over is not None:
            limit = f"{lockstep.max_response_s * 1000:g} ms (at most {lockstep.response_over * 100:g} %)"
            reason = f"{over} of {answers} answers took longer than {limit}: {response.in_words()}"
            self._judge(SLOW_ANSWERS, (over / answers,) * 2, lockstep.response_over, reason, who, "")
        if lockstep.is_copied:
            reason = f"{response.uncopied} of {answers} answers did not carry the sample time of their frame"
            self._judge(SAMPLE_TIMES, (response.uncopied,) * 2, 0, reason, who, "")
        if response.slow > MOST_SLOW * answers:
            slow = f"{response.slow} of {answers} answers took longer than the frames' period"
            period = f"{response.period_s * 1000:g} ms"
            self.notes.append(f"too slow for real time: {slow} of {period}; {response.in_words()}")

    def judge_use(self, uses: Sequence[ServiceUse], limits: ResourceLimits | None) -> None:
        """Judges what each service used by the limits of the test."""
        if limits is None:
            return
        for use in uses:
            for name, value, most, unit, words in (
                (PEAK_MEMORY, use.peak_memory_bytes / 1e6, limits.max_memory_mb, "MB", "used {:,.4g} MB of memory"),
                (PROCESSOR_TIME, use.processor_s, limits.max_processor_time_s, "s", "took {:.2f} s of processor time"),
                (PROCESSOR_SHARE, use.processor_share, limits.max_processor_share, "", "took {:.0f} % of a processor"),
            ):
                if most is None:
                    continue
                if value is None:
                    short = "is not judged: the test was too short to measure it"
                    self.notes.append(f"{name} of service '{use.service}' {short}")
                    continue
                at_most = f"at most {most:,.6g} {unit}" if unit else f"at most {most * 100:g} %"
                what = f"{words.format(value if unit else 100 * value)}, {at_most}"
                reason = f"application service '{use.service}' {what}"
                self._judge(f"{name}-{use.service}", (value, round(value, 3)), most, reason, use.service, unit)
        if not uses:
            self.notes.append(UNSEEN_USE)
