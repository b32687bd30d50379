"""The serial protocol and the rig in numbers.

Made of firmware/protocol.yml by scripts/make-protocol: change it there.
"""

from enum import IntEnum

BAUD = 115_200
LINE_LONGEST = 64
WATCHDOG = 0.5
"""s without RUN, or without any valid line during GOTO and CALIBRATE, after which the rig brakes."""
COMMANDS = {"GOTO": 3, "RUN": 3, "STOP": 0, "CALIBRATE": 0, "POSITION": 0, "STATUS": 0}
"""The number of arguments of each."""
BOUNDS = {
    "x": (-0.9, 0.95),
    "y": (-0.7, 0.7),
    "yaw": (-2.63386, 2.967059),
}
"""Lowest and highest position (m, m, rad): workspace and step 0."""
MICROSTEP = {
    "x": 2.35316265e-06,
    "y": 2.35316265e-06,
    "yaw": 0.000247916087,
}
"""m, m, rad."""
SPEED = {"x": 1.0, "y": 1.0, "yaw": 1.0}
"""Highest of each axis (m/s, m/s, rad/s)."""
ACCELERATION = {"x": 0.5, "y": 0.5, "yaw": 1.0}
"""Highest of each axis (m/s2, m/s2, rad/s2)."""


class Status(IntEnum):
    """What the rig says of itself."""

    IDLE = 0
    MOVING = 1
    HOMING = 2
    LIMIT = 3
    STALL = 4
    HOT = 5
    NOT_CALIBRATED = 6
    WATCHDOG = 7
    FAULT = 8


class Error(IntEnum):
    """Why a line was not obeyed."""

    UNKNOWN = 1
    COUNT = 2
    NUMBER = 3
    BOUNDS = 4
    DAMAGED = 5
    UNCALIBRATED = 6
    HOMING = 7
    TROUBLE = 8
    RESTARTED = 9
