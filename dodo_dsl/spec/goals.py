"""Soft goals: scores of checks, by which ``dodo rank`` compares applications."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """A check that scores 0 at ``zero``, 1 at ``one``, both in its unit, and linearly between; never beyond."""

    check: str
    zero: float
    one: float
    weight: float = 1.0

    def score(self, value: float | None) -> float:
        """Of a value, 0 to 1; a check without a value scores 0."""
        if value is None:
            return 0.0
        return min(1.0, max(0.0, (value - self.zero) / (self.one - self.zero)))


def is_goal(goal: Goal) -> bool:
    """Whether its numbers make a score; those of a file may be anything."""
    numbers = (goal.zero, goal.one, goal.weight)
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return False
    return goal.weight > 0 and goal.zero != goal.one
