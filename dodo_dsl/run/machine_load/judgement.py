"""What measured load means: a machine too busy for a verdict, or an application that is slow or takes too much.

A test in real time on a machine that was too busy ends in error. Answers in lockstep, by their times, and the
application's use of processors and memory become checks where the test asks for them, else notes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from dodo_dsl.outcome import (
    MEMORY_GROWTH,
    PEAK_MEMORY,
    PROCESSOR_SHARE,
    PROCESSOR_TIME,
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    Check,
    MachineLoad,
    Response,
    ServiceUse,
    megabytes,
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
WAY_OUT = "run it with --clock lockstep, or fewer tests at once (-j 1)"
TIMED_WAY_OUT = (
    "the application acts by its own clock: run it on a quiet machine (-j 1), or with --clock virtual, not in lockstep"
)


@dataclass(frozen=True)
class FindingUnderLoad:
    """A finding, and the load with which it was made."""

    finding: Finding
    load: MachineLoad | None


def consider(finding: Finding, load: MachineLoad | None, is_timed: bool = False) -> FindingUnderLoad:
    """An error in place of a failure that may be due to a busy machine; anything else as it is.

    ``is_timed`` means that the application acts by its own clock, so that lockstep does not help.

    Only findings that depend on time can turn. An application that waits for a tenth of the time answers each picture
    of a 10 Hz camera 10 ms later on average, some much later, as waits come in bursts: on two cores with four busy
    loops, the example application waited for a fifth of the time and more when it failed. DoDo's own services wait
    often and shortly at 100 Hz, which harms nobody as long as they keep to their schedule, so their lateness counts
    instead, in the same proportion. What the application brings upon itself, with many threads or long computations, is
    left out by the measure: a wait counts only while the machine was full and others than the application took at least
    half of what was taken. DoDo's own services are such others. An emulated rig that stood still for more than it takes
    to be late at all is another machine than the rig, whatever else was measured.
    """
    if load is None or finding.result != "failed" or not finding.is_verdict or not (why := too_busy(load)):
        return FindingUnderLoad(finding, load)
    found = finding.reason if len(finding.reason) <= _MAX_FOUND else f"{finding.reason[:_MAX_FOUND]}..."
    reason = f"the machine was too busy to judge: {why}; it found: {found}; {TIMED_WAY_OUT if is_timed else WAY_OUT}"
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


UNSEEN = "the limit of the time of an answer is not judged, because what containers wait for a processor cannot be seen"
MOST_SLOW = 0.1
"""Share of answers that may take longer than the frames' period before a note says so."""
MOST_SURPLUS_FRAMES = 0.1
"""Share of frames that may have surplus answers before a note says so."""
MOST_PERIODS = 10
"""The periods of frames that one answer may take before a note says so."""

_Judged = tuple[str, dict[str, Any]]
"""Why the application failed, or an empty text; and the check."""


@dataclass(frozen=True)
class JudgedFigures:
    """What follows from what was measured of the application."""

    findings: tuple[Finding, ...] = ()
    checks: tuple[Check, ...] = ()
    notes: tuple[str, ...] = ()


UNTIMED = "the time of answers is not judged, as with clock virtual computing takes no test time"


def judged_response(
    response: Response | None, lockstep: Lockstep | None, services: Sequence[str], timed: Sequence[str] = ()
) -> JudgedFigures:
    """Judges the answers by the limits of the test; ``services`` are the application's, ``timed`` those with timers."""
    if response is None or lockstep is None:
        return JudgedFigures()
    every = [*_times(response, lockstep), *_copies(response, lockstep)]
    who = services[0] if services else ""
    findings = tuple(Finding("failed", reason, who) for reason, _ in every if reason)
    return JudgedFigures(
        findings, tuple(with_margin(check) for _, check in every), tuple(_notes(response, lockstep, timed))
    )


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


def _notes(response: Response, lockstep: Lockstep, timed: Sequence[str]) -> Iterator[str]:
    if note := own_clock(response, timed):
        yield note
    if response.slow > MOST_SLOW * response.answers:
        slow = f"{response.slow} of {response.answers} answers took longer than the frames' period"
        yield f"too slow for real time: {slow} of {response.period_s * 1000:g} ms; {response.in_words()}"
    if response.worst_s > MOST_PERIODS * response.period_s:
        which = f" to frame {response.worst_frame}" if response.worst_frame else ""
        waits = " with what it waited for a processor" if response.processor_median_s is None else ""
        frames = f"{response.worst_s / response.period_s:.0f} frames, which outside lockstep would not have waited"
        yield f"the answer{which} took {response.worst_s:.3g} s{waits}, as long as {frames}"
    if lockstep.max_response_s is not None and response.over is None:
        yield UNTIMED
    is_unseen = response.processor_median_s is None and response.over is not None
    if is_unseen and (response.over or 0) > lockstep.response_over * response.answers:
        yield UNSEEN


def own_clock(response: Response, timed: Sequence[str] = ()) -> str:
    """That an application does not only answer frames, and what follows for its results; empty where it does.

    It is a note, and not an error: a program with timers may well give the same verdict each time, as one that answers
    each frame twice does, and of the drive that was judged everything is true.
    """
    frames, counts = response.answers + 1, []
    if timed:
        counts.append(f"'{timed[0]}' declares timers (x-dodo: timed)")
    if response.unasked:
        counts.append(f"it sent messages in {response.unasked} of {response.pauses} pauses without a frame")
    if response.surplus_frames > MOST_SURPLUS_FRAMES * frames:
        others = f", {response.differing} of them with other values" if response.differing else ""
        counts.append(f"{response.surplus} surplus answers in {response.surplus_frames} of {frames} frames{others}")
    if not counts:
        return ""
    if response.unasked or timed:
        way = "results can differ from run to run; run it with --clock realtime, or --clock virtual"
        return f"the application acts by its own clock: {'; '.join(counts)}: {way}"
    return f"{counts[0]}: the first answer to a frame counts, and the others are dropped"


SOON_S = 600.0
"""Memory that would reach its limit within this time, by the test's own, is worth a note."""
UNSEEN_USE = (
    "the limits of processor time and memory are not judged, because what the application uses cannot be measured here"
)
_MB, _MINUTE_S = 1e6, 60.0


class _Measure(NamedTuple):
    """A figure of a service with its limit; ``words`` say what it is, for a sentence."""

    check: str
    value: float | None
    limit: float | None
    unit: str
    words: str


def judged_use(uses: Sequence[ServiceUse], limits: ResourceLimits | None) -> JudgedFigures:
    """Judges what each service used by the limits of the test; its growth is noted whatever these are."""
    notes = [note for use in uses if (note := _growth_note(use))]
    if limits is None:
        return JudgedFigures(notes=tuple(notes))
    findings, checks = [], []
    for use in uses:
        for measure in _measures(use, limits):
            if measure.limit is None:
                continue
            if measure.value is None:
                notes.append(
                    f"{measure.check} of service '{use.service}' is not judged: the test was too short to measure it"
                )
                continue
            ok = measure.value <= measure.limit
            checks.append(_check(use, measure, ok))
            if not ok:
                reason = f"application service '{use.service}' {measure.words}, at most {_text(measure.limit, measure)}"
                findings.append(Finding("failed", reason, use.service))
    if not uses:
        notes.append(UNSEEN_USE)
    return JudgedFigures(tuple(findings), tuple(checks), tuple(notes))


def _measures(use: ServiceUse, limits: ResourceLimits) -> Iterator[_Measure]:
    peak, growth = use.peak_memory_bytes / _MB, use.memory_growth_bytes_per_s
    rate = None if growth is None else growth * _MINUTE_S / _MB
    share = use.processor_share
    yield _Measure(PEAK_MEMORY, peak, limits.max_memory_mb, "MB", f"used {peak:,.4g} MB of memory")
    yield _Measure(
        MEMORY_GROWTH, rate, limits.max_memory_growth, "MB/min", f"grew by {rate or 0.0:,.4g} MB/min in memory"
    )
    yield _Measure(
        PROCESSOR_TIME,
        use.processor_s,
        limits.max_processor_time_s,
        "s",
        f"took {use.processor_s:.2f} s of processor time",
    )
    yield _Measure(
        PROCESSOR_SHARE, share, limits.max_processor_share, "", f"took {(share or 0.0) * 100:.0f} % of a processor"
    )


def _check(use: ServiceUse, measure: _Measure, ok: bool) -> Check:
    name, value = f"{measure.check}-{use.service}", round(measure.value or 0.0, 3)
    return with_margin({"name": name, "value": value, "limit": {"max": measure.limit}, "unit": measure.unit, "ok": ok})


def _text(limit: float, measure: _Measure) -> str:
    return f"{limit:,.6g} {measure.unit}" if measure.unit else f"{limit * 100:g} %"


def _growth_note(use: ServiceUse) -> str:
    """What becomes of memory that grows, if that comes soon; the limit is that of the service."""
    growth, limit = use.memory_growth_bytes_per_s, use.memory_limit_bytes
    left_s = (limit - use.peak_memory_bytes) / growth if growth and limit else SOON_S
    if left_s >= SOON_S or not growth:
        return ""
    soon = "at once" if left_s < 1 else f"in {left_s:.0f} s" if left_s < 2 * _MINUTE_S else f"in {left_s / 60:.0f} min"
    return (
        f"the memory of application service '{use.service}' grows by {megabytes(growth)} in a second of test time, to "
        f"{megabytes(use.peak_memory_bytes)} so far: it would reach its limit of {megabytes(limit or 0)} {soon}"
    )
