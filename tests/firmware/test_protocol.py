"""The firmware's header, the service's table and the page of the serial protocol say the same."""

import math
import re
from typing import Any

import pytest

from services.gantry import rig_table as table
from services.gantry.rig_table import LIMITS, OFFSETS, STEPS
from tests.firmware.programs import ROOT

HEADER = (ROOT / "firmware" / "gantry" / "protocol.h").read_text(encoding="utf-8")
PAGE = (ROOT / "docs" / "reference" / "serial-protocol.md").read_text(encoding="utf-8")
CODES = {"status": table.Status, "error": table.Error, "source": table.Source}
MICROSTEPS, TICK = 128, 250e-9
"""A full step's, and the unit of time (s) of the L6470's registers."""
SPEED_UNITS, RAMP_UNITS, TOP_UNITS = 2**28 * TICK, 2**40 * TICK**2, 2**18 * TICK
"""Of a register per full step/s (SPEED), per full step/s2 (ACC, DEC), per full step/s (MAX_SPEED)."""
OWN: dict[str, dict[str, float]] = {
    "x": {"low": -0.95, "high": 0.95, "edge": 0.45, "homing": 0.1, "back_off": 0.003, "skew": 0.01, "square": 0.001},
    "y": {"low": -0.7, "high": 0.7, "edge": 0.45, "homing": 0.1, "back_off": 0.003, "skew": 0.01, "square": 0.001},
    "yaw": {"low": -170, "high": 170, "edge": 0.8, "homing": 0.35, "back_off": 4, "skew": 4, "square": 4},
    "circle": {"low": -360, "high": 360, "edge": 0.8, "homing": 0.35, "back_off": 16, "skew": 4, "square": 4},
}
"""The workspace (m, degrees), the planned braking before an edge (m/s2, rad/s2: less than the drivers do), homing's
speed, how far a switch that is closed at first is cleared, and how far y1 and y2 may be apart in homing and else."""


def defined(name: str) -> str:
    (found,) = re.findall(rf"^#define {name} (.*?)(?: /\*.*)?$", HEADER, re.MULTILINE)
    return str(found)


def defined_twice(name: str) -> list[str]:
    """Of the circle, and of the other kind."""
    return re.findall(rf"^#define {name} (.*?)(?: /\*.*)?$", HEADER, re.MULTILINE)


def numbers(text: str) -> list[int]:
    return [int(number) for number in re.findall(r"(-?\d+)L", text)]


def row(name: str) -> list[int]:
    """What the firmware needs of an axis, in the order of its header."""
    own, axis, circle = OWN[name], "yaw" if name == "circle" else name, name == "circle"
    to_si = math.pi / 180 if axis == "yaw" else 1.0
    per_unit = table.CIRCLE_STEPS / math.tau if circle else STEPS[axis] / to_si
    offset = table.CIRCLE_OFFSET if circle else OFFSETS[axis]
    low = own["low"] * to_si if circle else max(own["low"] * to_si, -offset / per_unit)
    fine = [round(own[key] * to_si * per_unit * MICROSTEPS) for key in ("back_off", "skew", "square")]
    return [
        round(per_unit * MICROSTEPS / 1e6 * 2**32),
        round(1e6 / (per_unit * MICROSTEPS) * 2**32),
        round(per_unit / 1e6 * SPEED_UNITS * 2**32),
        offset * MICROSTEPS,
        math.ceil(low * 1e6 - 1e-6),
        math.floor(own["high"] * to_si * 1e6 + 1e-6),
        round(table.SPEED[axis] * 1e6),
        round(2 * own["edge"] * 1e6 / 1e4),
        math.floor(table.SPEED[axis] * per_unit * TOP_UNITS),
        math.floor(table.ACCELERATION[axis] * per_unit * RAMP_UNITS),
        round(own["homing"] * per_unit * SPEED_UNITS),
        math.ceil(own["homing"] * per_unit * TOP_UNITS),
        *fine,
    ]


@pytest.mark.parametrize(("kind", "yaw"), [("DYNAMIC", "yaw"), ("CIRCLE", "circle")])
def test_axes_are_those_of_table_4_2_and_of_the_workspace(kind: str, yaw: str) -> None:
    block = HEADER.split(f"AXIS_ROWS_{kind} {{")[1].split("\n}")[0]
    found = [[int(n) for n in re.findall(r"(-?\d+)LL?", line)] for line in block.splitlines()[1:]]
    assert found == [row("x"), row("y"), row(yaw)]
    if kind == "DYNAMIC":
        assert {axis: tuple(n / 1e6 for n in r[4:6]) for axis, r in zip(STEPS, found, strict=True)} == table.BOUNDS
        assert {a: r[1] / 2**32 / 1e6 for a, r in zip(STEPS, found, strict=True)} == pytest.approx(table.MICROSTEP)
    assert (list(STEPS.values()), list(OFFSETS.values())) == ([3320, 3320, 0.55], [2988, 2324, 83])


def test_the_header_has_the_numbers_of_the_table() -> None:
    assert int(defined("BAUD").removesuffix("UL")) == table.BAUD
    assert int(defined("LINE_LONGEST")) == table.LINE_LONGEST
    assert int(defined("WATCHDOG_MS")) == 1000 * table.WATCHDOG
    assert 2 ** int(defined("STEP_MODE_REGISTER")) == int(defined("MICROSTEPS")) == MICROSTEPS
    assert numbers(defined("TURN")) == [table.TURN]
    degrees = [round(n / 360 * table.TURN) for n in table.INDEX]
    assert numbers(defined("INDEX_WIDTH")) + numbers(defined("INDEX_TOLERANCE")) == degrees


def test_limits_are_those_of_the_table() -> None:
    names = re.findall(r"LIMIT_([A-Z_]+)", re.findall(r"enum limit \{(.*)\}", HEADER)[0])
    assert [name.lower().replace("_", "-") for name in names] == list(LIMITS)
    for which, name in enumerate(("LIMITS_NARROWEST", "LIMITS_WIDEST")):
        circle, other = map(numbers, defined_twice(name))
        ends = {limit: round(1e6 * both[which]) for limit, both in LIMITS.items()}
        assert other == list(ends.values())
        assert circle == list((ends | {"yaw": round(1e6 * table.CIRCLE_YAW)}).values())


def test_commands_and_codes_are_those_of_header_table_and_page() -> None:
    own = {"LIMITS", "SETLIMITS", "FORGET"}
    assert set(table.COMMANDS) == {"GOTO", "RUN", "STOP", "CALIBRATE", "POSITION", "STATUS"} | own
    every = table.COMMANDS | table.CIRCLE_COMMANDS
    for rows, commands in zip(defined_twice("COMMAND_ROWS"), (every, table.COMMANDS), strict=True):
        assert re.findall(r'"(\w+)", (\d)', rows) == [(name, str(count)) for name, count in commands.items()]
    assert re.findall(r"COMMAND_(\w+)", re.findall(r"enum command \{(.*)\}", HEADER)[0]) == list(every)
    shown = re.findall(r"^\| `\$([A-Z]+)(?::([^`]*))?` \|", PAGE, re.MULTILINE)
    assert {name: len(words.split(",")) if words else 0 for name, words in shown} == every
    pages = re.findall(r"^\| (\d+) \| ([A-Z_]+) \|", PAGE, re.MULTILINE)
    expected: list[Any] = []
    for name, codes in CODES.items():
        (enum,) = re.findall(rf"enum {name} \{{(.*)\}}", HEADER)
        members = [(str(code.value), code.name) for code in codes]
        assert [(number, word) for word, number in re.findall(rf"{name.upper()}_(\w+) = (\d+)", enum)] == members
        expected += members
    assert pages == expected and [status.value for status in table.Status] == list(range(9))
