"""What constants are worth that were fitted to readings of a ruler and a protractor, which show divisions of a size."""

import math
from collections.abc import Iterator

from dodo_dsl.cli.rig_measure import SHARE
from dodo_dsl.run.rigs.axis_calibration import AXES, Reading, fit
from services.gantry.rig_table import BOUNDS, OFFSETS, STEPS

SHOWN = {"x": 0.001, "y": 0.001, "yaw": 0.5}
"""The divisions (m, m, degrees)."""


def edges(name: str) -> tuple[float, float]:
    """The lowest and highest place (m, degrees)."""
    low, high = BOUNDS[name]
    return (math.degrees(low), math.degrees(high)) if name == "yaw" else (low, high)


def _influences(name: str, places: int, edge: float) -> Iterator[float]:
    """By how much the place at an edge is off when one reading is off by half a division (m, degrees)."""
    low, high = edges(name)
    middle, half = (low + high) / 2, SHARE * (high - low) / 2
    goals = [middle - half + 2 * half * index / (places - 1) for index in range(places)]
    for wrong in range(places):
        read = [goal + SHOWN[name] / 2 * (index == wrong) for index, goal in enumerate(goals)]
        rows = [Reading(STEPS[name] * g + OFFSETS[name], r) for g, r in zip(goals, read, strict=True)]
        yield abs(fit(AXES[name], rows).place(STEPS[name] * edge + OFFSETS[name]) - edge)


def reached(name: str, places: int) -> tuple[float, float]:
    """The standard deviation at the worse edge with readings that are rounded at random, and the most (m, degrees)."""
    found = [list(_influences(name, places, edge)) for edge in edges(name)]
    typical = max(math.sqrt(math.fsum(one**2 for one in each) / 3) for each in found)
    return typical, max(map(math.fsum, found))
