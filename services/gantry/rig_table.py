"""The serial protocol and the rig in numbers; firmware/gantry/protocol.h has the same, and the tests compare them."""

from enum import IntEnum

BAUD = 115_200
LINE_LONGEST = 64
WATCHDOG = 0.5
"""s without RUN, or without any valid line during GOTO and CALIBRATE, after which the rig brakes."""
COMMANDS = {
    "GOTO": 3,
    "RUN": 3,
    "STOP": 0,
    "CALIBRATE": 0,
    "POSITION": 0,
    "STATUS": 0,
    "LIMITS": 0,
    "SETLIMITS": 7,
    "FORGET": 0,
}
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
STEPS = {"x": 3320, "y": 3320, "yaw": 0.55}
"""Full steps per m, m, degree: c of Table 4.2."""
OFFSETS = {"x": 2988, "y": 2324, "yaw": 83}
"""Full steps from home to 0: the offsets of Table 4.2."""
SPEED = {"x": 1.0, "y": 1.0, "yaw": 1.0}
"""Highest of each axis (m/s, m/s, rad/s)."""
ACCELERATION = {"x": 0.5, "y": 0.5, "yaw": 1.0}
"""Highest of each axis (m/s2, m/s2, rad/s2)."""
LIMITS = {
    "x": (0.1, 1.85),
    "y": (0.1, 1.4),
    "yaw": (0.174533, 2.967059),
    "speed": (0.1, 1.0),
    "yaw-rate": (0.5, 1.0),
    "acceleration": (0.1, 0.5),
    "yaw-acceleration": (0.5, 1.0),
}
"""Narrowest and widest limits that the rig's memory may have (m, m, rad, m/s, rad/s, m/s2, rad/s2)."""
CIRCLE_YAW = 6.283185
"""rad, the same of a yaw that turns without end: there is no other."""
CIRCLE_STEPS = 200
CIRCLE_OFFSET = 100
"""Full steps of a turn of a rig that turns without end, and from its index to heading 0."""
TURN = 25_600
"""Microsteps of a turn of a rig that turns without end."""
CIRCLE_COMMANDS = {"GOTOLEFT": 3, "GOTORIGHT": 3}
"""Commands that only such a rig has, and the number of arguments of each."""
INDEX = 10, 3
"""Degrees below the heading backward in which its index is closed, and by which it may be elsewhere."""


class Status(IntEnum):
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
    UNKNOWN = 1
    COUNT = 2
    NUMBER = 3
    BOUNDS = 4
    DAMAGED = 5
    UNCALIBRATED = 6
    HOMING = 7
    TROUBLE = 8
    RESTARTED = 9
    BUSY = 10


class Source(IntEnum):
    BUILT = 0
    KEPT = 1
    DAMAGED = 2
    WRITING = 3
