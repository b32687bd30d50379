"""A check in words and as a bar: its value, its limits, what it means, and which check of a test is shown first."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from dodo_dsl.outcome import (
    PEAK_MEMORY,
    PROCESSOR_SHARE,
    PROCESSOR_TIME,
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    Outcome,
    differs_each_run,
    with_margin,
)

Check = Mapping[str, Any]
_OF_THE_WAY = ("time-to-goal", "to-goal", "gates")
"""What a drive that ends early leaves undone."""
_ENDING = ("wall-margin", "body-margin", "max-speed", "silence")
"""What ends it early."""
_WORDS = {"min": ("at least", "more than"), "max": ("at most", "less than")}
"""For a limit that may be reached, and for one that may not."""
_DIGITS, _MOST_DIGITS, _LARGE = 3, 9, 1e7


def number(value: float, digits: int = _DIGITS) -> str:
    """Three digits, of whole numbers all of them: ``0.00659``, ``25``, ``1280``."""
    if abs(value) >= _LARGE or not math.isfinite(value):
        return f"{value:.{digits}g}"
    if value == int(value):
        return str(int(value))
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if decimals > digits + 1:
        return f"{value:.{digits}g}"
    return f"{value:.{decimals}f}".rstrip("0").rstrip(".") if decimals > 0 else f"{value:.0f}"


def measured(check: Check) -> str:
    """A check's value with its unit, in as many digits as distinguish it from its limits."""
    value, limits = check["value"], (check.get("limit") or {}).values()
    if value is None:
        return "none"
    digits = _DIGITS
    while digits < _MOST_DIGITS and any(value != x and number(value, digits) == number(x, digits) for x in limits):
        digits += 1
    return f"{number(value, digits)} {check.get('unit') or ''}".rstrip()


def only_follows(check: Check, checks: Sequence[Check]) -> bool:
    """Whether a check of a test is not met only as another one ended the drive."""
    may_follow = not check["ok"] and check["name"] in _OF_THE_WAY
    return may_follow and any(not other["ok"] and other["name"] in _ENDING for other in checks)


def bound(side: str, limit: float, unit: str = "", exclusive: bool = False) -> str:
    """``at least 1 m`` or ``more than 1 m`` for the side ``min``, ``at most 1 m`` or ``less than 1 m`` for ``max``."""
    return f"{_WORDS[side][exclusive]} {limit:g} {unit}".rstrip()


def limits(check: Check) -> Iterator[str]:
    """Each limit of a check: ``at least 0.03 m`` and ``at most 1 m``."""
    limit = check.get("limit") or {}
    exclusive = bool(check.get("exclusive")) or (not check["ok"] and check["value"] in limit.values())
    for side in ("min", "max"):
        if side in limit:
            yield bound(side, limit[side], check.get("unit") or "", exclusive)


def in_words(check: Check) -> str:
    """``wall-margin 0.0742 m (more than 0 m)``"""
    limit = ", ".join(limits(check))
    return f"{check['name']} {measured(check)}{f' ({limit})' if limit else ''}"


def check_line(check: Check, checks: Sequence[Check]) -> str:
    """A check of a test in a line."""
    if only_follows(check, checks):
        return f"--   {check['name']}: {measured(check)}, when the drive ended"
    return f"{'ok  ' if check['ok'] else 'FAIL'} {in_words(check).replace(' ', ': ', 1)}"


def lines(outcome: Outcome) -> list[str]:
    return [check_line(check, outcome.checks) for check in outcome.checks]


def with_margins(check: Check) -> Check:
    """The check with ``margin`` and ``margin_share``, computed where an older ``results.json`` has none."""
    return check if "margin" in check and "margin_share" in check else with_margin({"limit": {}, **check})


def share(check: Check) -> float | None:
    """How near a check is to failing, -1 to 1; None where that says nothing.

    That is so of what differs from run to run, and of a value that could not be better: three gates of three, a share
    of 1, an error of 0.
    """
    found, limit, value = with_margins(check)["margin_share"], check.get("limit") or {}, check["value"]
    if not found or differs_each_run(check["name"]):
        return None
    is_whole_share = not check.get("unit") and value == 1 and 0 < limit.get("min", 0) <= 1
    return None if check["ok"] and (is_whole_share or (value == 0 and limit.get("max", 0) > 0)) else found


def decisive(outcome: Outcome) -> Check | None:
    """The check to show of a test: the first that failed, else its headline, else the one nearest to failing."""
    failed = (check for check in outcome.checks if not check["ok"] and not only_follows(check, outcome.checks))
    headline = (check for check in outcome.checks if check["name"] == outcome.headline)
    near = min((c for c in outcome.checks if share(c)), key=lambda c: share(c) or 0.0, default=None)
    return next(failed, None) or next(headline, None) or near


def title(outcome: Outcome) -> str:
    """The first of the reasons, and how many more there are; of a test that passed, without its values.

    A reason that says of a check how far it is from its limit is replaced by that check as it reads elsewhere.
    """
    if outcome.outcome == "passed":
        return outcome.reason.partition(": ")[0].partition("; ")[0]
    first, *others = outcome.reason.split("; ")
    failed = [check for check in outcome.checks if not check["ok"] and not only_follows(check, outcome.checks)]
    if failed and "(at " in first:
        first, *others = map(in_words, failed)
    return f"{first} (+{len(others)} more)" if others else first


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
    PEAK_MEMORY: "most memory that the service used at once",
    PROCESSOR_TIME: "processor time that the service used",
    PROCESSOR_SHARE: "processor time that the service used, divided by the test's time",
    SAMPLE_TIMES: "answers without the sample time of their frame",
    SLOW_ANSWERS: "share of the answers that took longer than the test allows",
}
"""By the names of checks, as the READMEs of the evaluators define them."""
_BESIDE = {
    "distance": ("mean", "largest distance of a sample from the target"),
    "broken": ("delay", "answers that are not finite numbers"),
    "frames": ("delay", "frames that were answered in time"),
    "late": ("delay", "answers that came too late to count"),
    "share": ("delay", "share of the frames that were answered in time"),
}
"""What the same names mean beside another check."""
_PREFIXES = (PEAK_MEMORY, PROCESSOR_TIME, PROCESSOR_SHARE, "precision", "recall", "f1")
"""Of checks of each service, or of each class."""


def meaning(check: Check, others: Collection[str] = ()) -> str:
    """What a check measures, in a few words; ``others`` are the names of its test's checks. Empty where unknown."""
    name = check["name"]
    beside, words = _BESIDE.get(name, ("", ""))
    if beside in others:
        return words
    prefix = next((each for each in _PREFIXES if name.startswith(f"{each}-")), "")
    return MEANINGS.get(name) or MEANINGS.get(prefix, "")


_ONE, _TWO = {"min": 50, "max": 50}, {"min": 25, "max": 75}
"""Where the limit of a check is on a bar that is 100 wide, and where both are."""
_LEAST = 2


def bar_place(check: Check) -> tuple[int, int, int, int, bool] | None:
    """The bar from a check's nearest limit to its value, None without both, on a scale of 100 that grows to the right.

    Its parts: from where to where values are allowed, where the bar begins, its width, and whether the check holds.
    Beyond a limit, ``margin_share`` is the length, so that every value finds room.
    """
    check = with_margins(check)
    limit, value, length = check.get("limit") or {}, check["value"], check.get("margin_share")
    if value is None or length is None or not math.isfinite(length):
        return None
    at = _TWO if len(limit) == 2 else _ONE
    near = min(limit, key=lambda side: abs(value - limit[side]))
    room = 50 if len(limit) == 1 or length > 0 else 25
    reached = 0.0 if not check["ok"] and (check["margin"] or 0.0) >= 0 else length  # a wall that is touched
    end = round(room * reached) * (1 if near == "min" else -1)
    first, last = at["min"] if "min" in limit else 0, at["max"] if "max" in limit else 100
    return first, last, min(at[near], at[near] + end), max(abs(end), _LEAST), check["ok"]


def bar(check: Check) -> Markup:
    """``bar_place`` as a picture; empty without one."""
    found = bar_place(check)
    if found is None:
        return Markup()
    first, last, left, width, is_ok = found
    edges = "".join(f"<rect class=edge x={at}% />" for at in (first, last) if 0 < at < 100)
    return Markup(  # noqa: S704  (numbers)
        f"<svg class=bar><rect class=room x={first}% width={last - first}% />"
        f"<rect class={'ok' if is_ok else 'no'} x={left}% width={width}% />{edges}</svg>"
    )
