"""How far a check is from its limit, and a test from failing."""

import math
import sys
from collections.abc import Mapping
from typing import Any

from dodo_dsl.outcome import Outcome, differs_each_run


def with_margin(check: Mapping[str, Any]) -> dict[str, Any]:
    """A check with its ``margin`` and ``margin_share``, None where it has no value or no limit.

    ``margin`` is the distance of the value to its nearest limit in the check's unit, negative beyond the limit.
    ``margin_share`` is margin / (abs(margin) + size), which lies between -1 and 1 and is 0 at the limit. The size is
    half the range between both limits, that of the limit where there is one, and one unit where that is 0. It agrees
    with ``ok``: a check that holds has no negative share, and one that fails at its limit or within has -1, as a wall
    that is touched.
    """
    return {**check, "margin": (margin := _margin(check)), "margin_share": _share(check, margin)}


def worst_margin(outcome: Outcome) -> float | None:
    """How far a test is from failing, -1 to 1: the least share of its checks; negative exactly where it failed.

    None for an error, -1 for a failed test without a failing check that has a value. A check that holds with nothing
    to spare does not count, as three gates of three or no broken sample: it cannot be better. Nor does what differs
    from run to run, as the time of answers. 0 where no check is left of a passed test. A check that fails at its
    limit, as a wall that is touched, does not say by how much, and counts only where no other check that failed does.
    """
    if outcome.outcome == "error":
        return None
    is_failed = outcome.outcome == "failed"
    counting = [
        check
        for check in outcome.checks
        if check["ok"] is not is_failed and (is_failed or not differs_each_run(check["name"]))
    ]
    shares = (check.get("margin_share") for check in counting if not is_failed or (check.get("margin") or 0.0) < 0)
    return min((share for share in shares if share), default=-1.0 if is_failed else 0.0)


def failed_checks(outcome: Outcome) -> tuple[str, ...]:
    """The names of the checks that failed, but for those that differ from run to run."""
    names = {check["name"] for check in outcome.checks if not check["ok"]}
    return tuple(sorted(name for name in names if not differs_each_run(name)))


def _margin(check: Mapping[str, Any]) -> float | None:
    value, limit = check["value"], check["limit"]
    distances = []
    if value is not None and "min" in limit:
        distances.append(float(value) - float(limit["min"]))
    if value is not None and "max" in limit:
        distances.append(float(limit["max"]) - float(value))
    if not distances:
        return None
    return max(-sys.float_info.max, min(sys.float_info.max, *distances))


def _share(check: Mapping[str, Any], margin: float | None) -> float | None:
    if margin is None:
        return None
    if not check["ok"] and margin >= 0:
        return -1.0
    if margin == 0 or (check["ok"] and margin < 0):
        return 0.0
    return math.copysign(max(1 / (1 + _size(check["limit"]) / abs(margin)), sys.float_info.min), margin)


def _size(limit: Mapping[str, float]) -> float:
    bounds = [float(bound) for bound in limit.values()]
    return abs(max(bounds) / 2 - min(bounds) / 2) or abs(bounds[0]) or 1.0
