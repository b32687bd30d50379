"""The moment that decided a test, at which its page opens."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl.outcome import Outcome

_GAPS = ("gap", "coverage", "unanswered")
"""Checks that a hole decides, with its start as evidence."""
END = "the end of the test"
"""What a test has that no verdict decided."""


@dataclass(frozen=True)
class Moment:
    """A time in s of the test, what was then, and the place in m where that is known."""

    time: float
    what: str
    x: float | None = None
    y: float | None = None


def decisive(outcome: Outcome, duration: float) -> Moment:
    """The evidence of the verdict that became the outcome; without one the end, as what else decides ends a test."""
    evidence = next((v["evidence"] for v in outcome.verdicts if v["evaluator"] == outcome.decided_by), {})
    time = _time(evidence, {check["name"] for check in outcome.checks if not check["ok"]})
    if time is None:
        return Moment(duration, END)
    return Moment(max(time[0], 0.0), time[1], _number(evidence.get("x")), _number(evidence.get("y")))


def _time(evidence: Mapping[str, Any], failed: set[str]) -> tuple[float, str] | None:
    broken, gap, worst = (_number(evidence.get(key)) for key in ("broken-time", "gap-begin", "time"))
    if "broken" in failed and broken is not None:
        return broken, "the first sample that is not a number"
    if failed and failed <= {*_GAPS, "samples", "answered"} and gap is not None:
        return gap, "the start of the longest silence"
    if worst is None:
        return None
    if "obstacle" in evidence:
        return worst, f"touched {evidence['obstacle']}"
    if "target" in evidence:
        return worst, "the sample farthest from its target"
    return worst, "the frame with the most mistakes" if "missed" in evidence else "the verdict"


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
