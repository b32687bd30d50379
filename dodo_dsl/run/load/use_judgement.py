"""What the application's use of processors and memory means: checks where the test asks for them, else notes."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from dodo_dsl.margins import with_margin
from dodo_dsl.outcome import MEMORY_GROWTH, PEAK_MEMORY, PROCESSOR_SHARE, PROCESSOR_TIME, ServiceUse, megabytes
from dodo_dsl.run.load.response import JudgedFigures
from dodo_dsl.run.outcomes import Finding
from dodo_dsl.spec.resource_limits import ResourceLimits

SOON_S = 600.0
"""Memory that would reach its limit within this time, by the test's own, is worth a note."""
UNSEEN = "the limits of processor time and memory are not judged, as what the application uses cannot be measured here"
_MB, _MINUTE_S = 1e6, 60.0


class _Measure(NamedTuple):
    """A figure of a service with its limit; ``words`` say what it is, for a sentence."""

    check: str
    value: float | None
    limit: float | None
    unit: str
    words: str


def judged(uses: Sequence[ServiceUse], limits: ResourceLimits | None) -> JudgedFigures:
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
                    f"{measure.check} of service '{use.service}' is not judged: the test was too short to tell"
                )
                continue
            ok = measure.value <= measure.limit
            checks.append(_check(use, measure, ok))
            if not ok:
                reason = f"application service '{use.service}' {measure.words}, at most {_text(measure.limit, measure)}"
                findings.append(Finding("failed", reason, use.service))
    if not uses:
        notes.append(UNSEEN)
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


def _check(use: ServiceUse, measure: _Measure, ok: bool) -> dict[str, Any]:
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
