"""The rig's measures in mm and degrees: those of the firmware, and those that were chosen for a rig to be built.

x is forward, y to the left, z up; 0 is the middle of the workspace on the table's top.
"""

import math
from dataclasses import dataclass

from services.gantry.rig_table import BOUNDS, CIRCLE_STEPS, INDEX, OFFSETS, STEPS

HOME_CLOSES, FAR_CLOSES, FRAME = 1.0, 5.0, 20.0
"""From step 0 to where its switch closes, from the highest place to the other switch, from both places to the frame."""
YAW_HOME_CLOSES, YAW_FAR_CLOSES, YAW_FRAME = 1.0, 1.5, 8.0
"""The same of the yaw, in degrees: as the emulated rig has them (firmware/emulator/plant/plant.c)."""
OVERTRAVEL = 90.0
"""Between a switch and the frame of a rig that shall go 1 m/s (firmware/README.md)."""
THESIS_RAILS = {"x": 2000.0, "y": 1500.0}

LENS = 95.0
"""Height of the lens: the default of projected-truth, and what the shipped tests give to virtual-camera."""
CARRIAGE = 100.0
"""Chosen: the length of a carriage along its rail, buffers included."""
PLATE = 4.0
"""Thickness of the camera's holder."""


@dataclass(frozen=True)
class Travel:
    """An axis from step 0 to its highest place, in mm or degrees."""

    name: str
    low: float
    high: float
    steps: float
    offset: float

    @property
    def length(self) -> float:
        return self.high - self.low

    def rail(self, room: float | None = None) -> float:
        """Length of the rail with the ends of the frame at FRAME, or with so much room behind each switch."""
        ends = 2 * FRAME if room is None else HOME_CLOSES + FAR_CLOSES + 2 * room
        return self.length + ends + CARRIAGE


def _travel(name: str) -> Travel:
    unit = math.degrees(1) if name == "yaw" else 1000.0
    low = -OFFSETS[name] / STEPS[name] * (1.0 if name == "yaw" else 1000.0)
    return Travel(name, low, BOUNDS[name][1] * unit, STEPS[name], OFFSETS[name])


X, Y, YAW = map(_travel, ("x", "y", "yaw"))
INDEX_WIDTH = float(INDEX[0])
"""Degrees in which the index of a rig of the kind circle is closed, clockwise from the heading backward."""
CIRCLE_STEP = 360.0 / CIRCLE_STEPS
