"""Measuring axes: the rig moves to places, and somebody reads where it truly is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from dodo_dsl.calibration.axis_line import Axis, AxisLine, Reading, ReadingOff, fit
from dodo_dsl.calibration.readings import Readings, ReadingsError, place

SHARE = 0.8
"""Of each range that is measured: the constants may be wrong by up to 10 % and 10 cm before."""
RETAKES = 2
ANY_HEADING = (-150.0, 150.0)
"""degrees, of a yaw without bounds."""
_DECIMALS = {"m": 2, "deg": 0}


@dataclass(frozen=True)
class AxisSession:
    """``move`` gives the answer of the gantry's program to an action, ``ask`` that of a person to a prompt.

    Whatever was read is in ``readings``, also after an error.
    """

    move: Callable[[Sequence[str]], dict[str, Any]]
    ask: Callable[[str], str]
    say: Callable[[str], None]
    count: int
    readings: Readings

    def home(self, name: str) -> dict[str, Any]:
        """Lets the rig find its home, after somebody permitted it; the places within its reach."""
        self.ask(f"rig '{name}' finds its home first: clear its workspace, and press Enter ")
        reach: dict[str, Any] = self.move(["calibrate"])["reach"]
        return reach

    def measure(self, axis: Axis, limits: Sequence[float] | None) -> AxisLine:
        """Reads as many places of an axis as are wanted; one that the others contradict is read again."""
        goals = _goals(limits or ANY_HEADING, self.count, _DECIMALS[axis.unit])
        readings = self.readings[axis.name] = []
        readings.extend(self._read(axis, goal, f"{number} of {len(goals)}") for number, goal in enumerate(goals, 1))
        for _ in range(RETAKES):
            try:
                return fit(axis, readings)
            except ReadingOff as off:
                if off.index is None:
                    raise
                self.say(f"{off}; it is read again")
                readings[off.index] = self._read(axis, goals[off.index], "again")
        return fit(axis, readings)

    def _read(self, axis: Axis, goal: float, which: str) -> Reading:
        place_of = {"x": 0.0, "y": 0.0, "yaw": 0.0, axis.name: goal}
        answer = self.move(["goto", *(f"{value:g}" for value in place_of.values())])
        counted = f"the rig stands at {axis.shown(answer[axis.name])} by its counters"
        prompt = f"{axis.name}, {which}: {counted}. Its true place, such as {axis.shown(goal)}: "
        while True:
            try:
                return Reading(answer["steps"][axis.name], place(axis, self.ask(prompt)))
            except ReadingsError as error:
                self.say(str(error))


def _goals(limits: Sequence[float], count: int, decimals: int) -> list[float]:
    low, high = limits
    middle, half = (low + high) / 2, SHARE * (high - low) / 2
    return [round(middle - half + 2 * half * index / (count - 1), decimals) for index in range(count)]
