"""The verdict on a signal in one sentence."""

from services.base import Check, Verdict
from services.continuous_signal.coverage import Coverage
from services.continuous_signal.late import LateFacts
from services.continuous_signal.measures import SignalLimits, SignalMeasures
from services.continuous_signal.target import Target

_NAMES = {
    "mean": "the mean distance",
    "std": "the standard deviation",
    "distance": "the largest distance",
    "mean-over-time": "the mean distance over time",
    "std-over-time": "the standard deviation over time",
}
_KEPT = ("mean", "std", "distance", "share")
_AT_ONCE = {"mean-over-time": "mean", "std-over-time": "std"}
"""Not told when the same over samples broke the limit, too."""


def verdict(
    signal: str, target: Target, measures: SignalMeasures, limits: SignalLimits, during: str, late: LateFacts
) -> Verdict:
    """Passed when every limit is kept; ``during`` is the observed time in words."""
    checks = (*measures.checks(limits), Check("late", late.samples))
    broken = {check.name: check for check in checks if not check.ok}
    told = [check for name, check in broken.items() if _AT_ONCE.get(name) not in broken]
    faults = [_fault(check, measures, limits) for check in told] if measures.samples else []
    faults = faults or ([] if measures.samples else [_nothing(signal, target, measures, during, late)])
    if faults:
        silent = not measures.received and not late.samples
        aside = _late(late) if measures.samples and late.samples else ""
        likeness = f"; the signal is {measures.likeness}" if measures.likeness and "repeats" not in broken else ""
        return Verdict("failed", "; ".join(faults) + likeness + _worst(measures) + aside, checks, silent=silent)
    kept = [f"{check.name} {_number(check.value)} ({_bound(check)})" for check in checks if _is_kept(check)]
    samples = f"{signal} kept to its target over {measures.samples} samples"
    aside = _late(late) if late.samples else ""
    return Verdict("passed", f"{samples}: {', '.join(kept)}{_worst(measures)}{aside}", checks)


def _is_kept(check: Check) -> bool:
    return bool(check.limit) and check.name in _KEPT


def _nothing(signal: str, target: Target, measures: SignalMeasures, during: str, late: LateFacts) -> str:
    if not measures.received:
        return f"no sample of {signal} came {during}" + (_late(late, ", but ") if late.samples else "")
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
    if check.name == "lag":
        return f"it lags its target by {value} s ({bound} s)"
    if check.name == "repeats":
        which = (
            f", {_number(measures.repeats.value)}, from {measures.repeats.time:.2f} s on" if measures.repeats else ""
        )
        return f"{value} samples in a row have the same value{which} ({bound})"
    if check.name == "share":
        return f"the share of time within {_number(limits.band)} of the target is {value} ({bound})"
    if check.name in ("gap", "coverage"):
        return _hole(check, measures.coverage)
    return f"{_NAMES[check.name]} is {value} ({bound})"


def _hole(check: Check, coverage: Coverage | None) -> str:
    """What was left open, and how long that may be."""
    bound = _bound(check)
    if coverage is None:
        return f"{check.name} has no value ({bound})"
    if check.name == "gap":
        return f"nothing came between {coverage.gap_begin:.2f} s and {coverage.gap_end:.2f} s ({bound} s)"
    judged = f"the time from {coverage.begin:.2f} s to {coverage.end:.2f} s"
    return f"the samples cover {_value(check)} of {judged} ({bound})"


def _late(late: LateFacts, begin: str = "; left out: ") -> str:
    """Samples that were not believed, with the first."""
    count = f"{late.samples} sample{'' if late.samples == 1 else 's'}"
    where = "after newer ones" if late.arrival is None else f"which came at {late.arrival:.2f} s"
    return f"{begin}{count} whose time is not that of the arrival, the first of {late.time:.2f} s, {where}"


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
