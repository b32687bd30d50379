"""Whether a machine was too busy for a verdict in real time; the test then ends in error."""

from dataclasses import dataclass, replace

from dodo_dsl.outcome import MachineLoad
from dodo_dsl.run.outcomes import Finding

MOST_WAITED = 0.1
"""Share of the test's time that a service may have waited for a processor."""
LEAST_WAITED_S = 0.25
"""Seconds that a service may have waited in any case: a test that ends at once is not decided by a tenth of it."""
MOST_LATE = 0.1
"""Share of the pictures, or of a service's other updates, that may have come later than half a period."""
LEAST_CROWDED = 0.1
"""Share of the test's time in which others must have filled the machine for lateness to be their fault."""
_MAX_FOUND = 300
WAY_OUT = "run it with --clock lockstep, or fewer tests at once (-j 1)"


@dataclass(frozen=True)
class FindingUnderLoad:
    """A finding, and the load with which it was made."""

    finding: Finding
    load: MachineLoad | None


def consider(finding: Finding, load: MachineLoad | None) -> FindingUnderLoad:
    """An error in place of a failure that may be due to a busy machine; anything else as it is.

    Only findings that depend on time can turn. An application that waits for a tenth of the time answers each picture
    of a 10 Hz camera 10 ms later on average, some much later, as waits come in bursts: on two cores with four busy
    loops, the example application waited for a fifth of the time and more when it failed. DoDo's own services wait
    often and shortly at 100 Hz, which harms nobody as long as they keep to their schedule, so their lateness counts
    instead, in the same proportion. What the application brings upon itself, with many threads or long computations, is
    left out by the measure: a wait counts only while the machine was full and others than the application took at least
    half of what was taken. DoDo's own services are such others. An emulated rig that stood still for more than it takes
    to be late at all is another machine than the rig, whatever else was measured.
    """
    if load is None or finding.result != "failed" or not finding.is_timed or not (why := too_busy(load)):
        return FindingUnderLoad(finding, load)
    found = finding.reason if len(finding.reason) <= _MAX_FOUND else f"{finding.reason[:_MAX_FOUND]}..."
    reason = f"the machine was too busy to judge: {why}; it found: {found}; {WAY_OUT}"
    return FindingUnderLoad(replace(finding, result="error", reason=reason), replace(load, undecided=True))


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
