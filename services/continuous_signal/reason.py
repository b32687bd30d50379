"""The verdict on a signal in one sentence."""

from services.base import Check, Verdict
from services.continuous_signal.measures import SignalLimits, SignalMeasures
from services.continuous_signal.target import Target

_NAMES = {"mean": "the mean distance", "std": "the standard deviation", "distance": "the largest distance"}


def verdict(signal: str, target: Target, measures: SignalMeasures, limits: SignalLimits, during: str) -> Verdict:
    """Passed when every limit is kept; ``during`` is the observed time in words."""
    checks = measures.checks(limits)
    faults = [] if measures.samples else [_nothing(signal, target, measures, during)]
    faults += [] if faults else [_fault(check, measures, limits) for check in checks if not check.ok]
    if faults:
        return Verdict("failed", "; ".join(faults) + _worst(measures), checks, silent=not measures.received)
    kept = [
        f"{check.name} {_number(check.value)} ({_bound(check)})"
        for check in checks
        if check.limit and check.name in (*_NAMES, "share")
    ]
    samples = f"{signal} kept to its target over {measures.samples} samples"
    return Verdict("passed", f"{samples}: {', '.join(kept)}{_worst(measures)}", checks)


def _nothing(signal: str, target: Target, measures: SignalMeasures, during: str) -> str:
    if not measures.received:
        return f"no sample of {signal} came {during}"
    if measures.broken:
        return (
            f"{signal} was not a finite number in {_times(len(measures.broken))}, first at {measures.broken[0]:.2f} s"
        )
    begin, end = target.span
    return f"none of {measures.received} samples of {signal} is from the target's time, {begin:.2f} s to {end:.2f} s"


def _fault(check: Check, measures: SignalMeasures, limits: SignalLimits) -> str:
    value, bound = _value(check), _bound(check)
    if check.name == "samples":
        aside = f", and {measures.outside} outside the target's time" if measures.outside else ""
        return f"only {value} samples came ({bound}){aside}"
    if check.name == "broken":
        return f"{value} samples are not finite numbers, the first at {measures.broken[0]:.2f} s"
    if check.name == "share":
        return f"the share of samples within {_number(limits.band)} of the target is {value} ({bound})"
    return f"{_NAMES[check.name]} is {value} ({bound})"


def _value(check: Check) -> str:
    """In full where rounding would hide that it broke its limit."""
    short = _number(check.value)
    return str(check.value) if short in map(_number, check.limit.values()) else short


def _worst(measures: SignalMeasures) -> str:
    worst = measures.worst
    if worst is None:
        return ""
    return f"; worst at {worst.time:.2f} s: {_number(worst.value)} with a target of {_number(worst.target)}"


def _bound(check: Check) -> str:
    side, limit = next(iter(check.limit.items()))
    return f"at {'most' if side == 'max' else 'least'} {_number(limit)}"


def _times(count: int) -> str:
    return "its one sample" if count == 1 else f"{count} samples"


def _number(value: float | None) -> str:
    return "nothing" if value is None else str(value) if isinstance(value, int) else f"{value:z.4g}"
