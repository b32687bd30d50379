"""How the report's pages show a check: what it means, and a bar from its limit to its value."""

import math
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from markupsafe import Markup

from dodo_dsl.outcome import MEMORY_GROWTH, PEAK_MEMORY, PROCESSOR_SHARE, PROCESSOR_TIME, SAMPLE_TIMES, SLOW_ANSWERS
from dodo_dsl.report.comparison import with_margins

Check = Mapping[str, Any]

MEANINGS = {
    "answered": "frames that the application answered",
    "ate": "root mean square of the distances between estimates and true positions",
    "body-margin": "smallest distance between the vehicle and another body",
    "broken": "samples that are not finite numbers",
    "coverage": "share of the time with a target that samples cover",
    "covered": "share of the area that the vehicle covered",
    "delay": "longest time between a frame and its answer",
    "distance": "distance that the vehicle drove",
    "error": "largest distance of an estimate from the true position",
    "estimates": "estimates of the pose that were judged",
    "f1": "precision and recall in one number: their harmonic mean",
    "false-negatives": "true boxes that no detection matches",
    "false-positives": "detections that match no true box",
    "frame-share": "share of the frames whose sample is within the band around the target",
    "frames": "frames that were judged",
    "gap": "longest time without a sample or an answer",
    "gates": "gates that the vehicle crossed in their order",
    "highest": "largest value that was sent",
    "lag": "how late the signal follows its target",
    "late": "samples or detections that came too late to be judged, ignored",
    "lowest": "smallest value that was sent",
    "max-speed": "highest speed of the vehicle",
    "mean": "mean distance of the samples from the target",
    "mean-iou": "mean overlap of the detections that match with their true boxes",
    "mean-over-time": "mean distance from the target, each sample weighted by the time that it holds",
    "outside": "samples at times without a target, ignored",
    "precision": "share of the detections that match a true box",
    "recall": "share of the true boxes that a detection matches",
    "repeated": "detections with a detectionId that their frame already had, ignored",
    "repeats": "most samples in a row with the same value",
    "rotation": "root mean square of the angles between estimates and true attitudes",
    "rotation-error": "largest angle between an estimate and the true attitude",
    "rpe": "root mean square of the errors of motion from pose to pose",
    "rpe-rotation": "root mean square of the errors of turns from pose to pose",
    "samples": "samples that were judged",
    "share": "share of the time within the band around the target",
    "sign-share": "share of the frames whose sample has the sign of the target",
    "silence": "longest time between two requests of the application",
    "std": "population standard deviation of the distance from the target",
    "std-over-time": "the same deviation, each sample weighted by the time that it holds",
    "time-to-cover": "test time until enough of the area was covered",
    "time-to-goal": "test time until the vehicle reached the goal",
    "to-goal": "distance that was left to the goal",
    "true-positives": "detections that match a true box",
    "unanswered": "share of the frames with true boxes that the application did not answer",
    "unmatched": "estimates without a true pose near in time",
    "wall-margin": "smallest distance between the vehicle and a wall",
    "without-truth": "frames without ground truth, ignored",
    SAMPLE_TIMES: "answers without the sample time of their frame",
    SLOW_ANSWERS: "share of the answers that took longer than the test allows",
}
"""By the names of checks, as the READMEs of the evaluators define them."""
_OF_RESPONDS = {
    "broken": "answers that are not finite numbers",
    "frames": "frames that were answered in time",
    "late": "answers that came too late to count",
    "share": "share of the frames that were answered in time",
}
"""What the same names mean beside ``delay``."""
_FROM_TARGET = "largest distance of a sample from the target"
_PREFIXES = {
    PEAK_MEMORY: "most memory that the service used at once",
    MEMORY_GROWTH: "how fast the service's memory grew in the second half of the test",
    PROCESSOR_TIME: "processor time that the service used",
    PROCESSOR_SHARE: "processor time that the service used, divided by the test's time",
    "precision": "the same as precision, for one class",
    "recall": "the same as recall, for one class",
    "f1": "the same as f1, for one class",
}


def meaning(check: Check, others: Collection[str] = ()) -> str:
    """What a check measures, in a few words; ``others`` are the names of its test's checks. Empty where unknown."""
    name = check["name"]
    if name == "distance" and "mean" in others:
        return _FROM_TARGET
    if name in _OF_RESPONDS and "delay" in others:
        return _OF_RESPONDS[name]
    prefixed = (words for prefix, words in _PREFIXES.items() if name.startswith(f"{prefix}-"))
    return MEANINGS.get(name) or next(prefixed, "")


_ONE, _TWO = {"min": 50, "max": 50}, {"min": 25, "max": 75}
"""Where the limit of a check is on a bar that is 100 wide, and where both are."""
_LEAST = 2


class BarPlace(NamedTuple):
    """The parts of a bar that is 100 wide, on which values grow to the right.

    From ``first`` to ``last`` values are allowed; the bar begins at ``left``.
    """

    first: int
    last: int
    left: int
    width: int
    ok: bool


def place(check: Check) -> BarPlace | None:
    """The bar from a check's nearest limit to its value, None without both.

    Beyond a limit, ``margin_share`` is the length, so that every value finds room.
    """
    check = with_margins(check)
    limits, value, share = check.get("limit") or {}, check["value"], check.get("margin_share")
    if value is None or share is None or not math.isfinite(share):
        return None
    at = _TWO if len(limits) == 2 else _ONE
    near = min(limits, key=lambda side: abs(value - limits[side]))
    room = 50 if len(limits) == 1 or share > 0 else 25
    reached = 0.0 if not check["ok"] and (check["margin"] or 0.0) >= 0 else share  # a wall that is touched
    length = round(room * reached) * (1 if near == "min" else -1)
    left, width = min(at[near], at[near] + length), max(abs(length), _LEAST)
    return BarPlace(
        at["min"] if "min" in limits else 0, at["max"] if "max" in limits else 100, left, width, check["ok"]
    )


class Bars:
    """The bars of a page, of which those that look the same are drawn once, in ``symbols`` at its end."""

    def __init__(self) -> None:
        self._numbers: dict[BarPlace, int] = {}

    def bar(self, check: Check) -> Markup:
        """``place`` as a picture; empty without one."""
        found = place(check)
        if found is None:
            return Markup()
        number = self._numbers.setdefault(found, len(self._numbers))
        return Markup(f'<svg class="bar"><use href="#_b{number}"/></svg>')  # noqa: S704  (a number)

    def symbols(self) -> Markup:
        """All of them, to be used above."""
        drawn = "".join(
            f'<symbol id="_b{number}" {_SCALED}>{_parts(found)}</symbol>' for found, number in self._numbers.items()
        )
        return Markup(f'<svg class="bar" hidden>{drawn}</svg>') if drawn else Markup()  # noqa: S704  (numbers)


_SCALED = 'viewBox="0 0 100 10" preserveAspectRatio="none"'


def _parts(found: BarPlace) -> str:
    edges = "".join(f"M{at} 0h1v10h-1z" for at in (found.first, found.last) if 0 < at < 100)
    return (
        f'<path class="room" d="M{found.first} 3H{found.last}v4H{found.first}z"/>'
        f'<path class="{"ok" if found.ok else "no"}" d="M{found.left} 2h{found.width}v6h-{found.width}z"/>'
        f'<path class="edge" d="{edges}"/>'
    )
