"""Constants that were measured on a rig: true places in commands and reports of the firmware."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.base import Flags
from services.base.flags import load_manifest, parse
from services.gantry import manual
from services.gantry.link import PortError
from services.gantry.memory import conversion_of, kept_limits, motion_limits, true_box
from services.gantry.motion import BUILT_IN, FARTHEST, HOME, AxisConstants, Conversion, MotionLimits, box
from services.gantry.protocol import Position
from services.gantry.rig_table import CIRCLE_YAW

FOLDER = Path(manual.__file__).parent
LONG = Conversion({"x": AxisConstants(3320 / 1.03, 2988 - 0.007 * 3320 / 1.03)})
"""A rig whose x is 3 % longer than built in, and 7 mm ahead."""


def places(built_in: Position) -> Position:
    return Position(1.03 * built_in.x + 0.007, built_in.y, built_in.yaw)


def test_what_is_built_in_converts_to_itself_exactly() -> None:
    place = Position(0.1234567, -0.7, 2.967059)
    assert Conversion().to_firmware(place) == Conversion().to_true(place) == place
    assert box(1.9, 1.4, math.radians(170)) == (HOME, FARTHEST) == (MotionLimits().low, MotionLimits().high)
    assert Conversion().steps(Position(0, 0, math.radians(1))) == pytest.approx({"x": 2988, "y": 2324, "yaw": 83.55})


@given(st.floats(-0.9, 0.95))
def test_measured_constants_give_true_places_and_the_same_steps(x: float) -> None:
    reported = Position(x, 0.1, -1)
    true = LONG.to_true(reported)
    assert (true.x, true.y, true.yaw) == pytest.approx((1.03 * x + 0.007, 0.1, -1))
    told = LONG.to_firmware(true)
    assert (told.x, told.y, told.yaw) == pytest.approx((x, 0.1, -1))
    assert LONG.steps(true) == pytest.approx(Conversion().steps(reported))


def test_limits_are_true_places_within_workspace_and_firmware() -> None:
    low, high = box(1.9, 1.4, math.radians(170), LONG)
    assert (low.x, high.x) == pytest.approx((1.03 * -0.9 + 0.007, 0.95))
    short = Conversion({"x": AxisConstants(3320 / 0.95, 2988), "yaw": AxisConstants(BUILT_IN["yaw"].steps, 72)})
    low, high = box(1.9, 1.4, math.radians(170), short)
    assert high.x == pytest.approx(0.95 * 0.95 + 2988 / 3320 * 0.95 - 2988 / 3320 * 0.95, abs=1e-9)
    assert math.degrees(low.yaw) == pytest.approx(-72 / 0.55, abs=0.01)
    assert box(0.5, 1.4, 1.0, LONG)[1].x == pytest.approx(low_of(LONG) + 0.5)


def low_of(conversion: Conversion) -> float:
    return conversion.to_true(HOME).x


def flags_of(*words: str) -> Flags:
    return parse(load_manifest(FOLDER), ["--cid=1", "--serial=/dev/ttyS0", *words])


def test_the_firmware_is_not_asked_for_more_than_its_speed() -> None:
    limits = motion_limits(flags_of("--steps-x=3500", "--steps-yaw=0.6"))
    assert limits.speed == pytest.approx(3320 / 3500) and limits.acceleration == pytest.approx(0.5 * 3320 / 3500)
    assert limits.yaw_rate == limits.yaw_acceleration == pytest.approx(0.55 / 0.6)


scales = st.floats(0.91, 1.1)


@given(
    scales, scales, scales, st.floats(-11, 11), st.floats(0.12, 1.9), st.floats(0.12, 1.4), st.floats(35, 170),
    st.floats(0.12, 1.0),
)  # fmt: skip
@pytest.mark.thorough
def test_what_the_memory_keeps_is_never_beyond_a_true_limit(
    x: float, y: float, yaw: float, shift: float, far_x: float, far_y: float, turn: float, speed: float
) -> None:
    words = [
        f"--steps-x={3320 / x}",
        f"--steps-y={3320 / y}",
        f"--steps-yaw={0.55 / yaw}",
        f"--offset-yaw={83 + shift}",
    ]
    names = {"x": far_x, "y": far_y, "yaw": math.radians(turn), "speed": speed}
    limits = ",".join(f"{name}={value:.7f}" for name, value in names.items())
    flags = flags_of(*words, f"--limits={limits}", f"--range-x={far_x}", f"--range-y={far_y}", f"--range-yaw={turn}")
    kept, conversion = kept_limits(flags), conversion_of(flags)
    home, end = (
        conversion.to_true(
            Position(HOME.x + share * kept["x"], HOME.y + share * kept["y"], (2 * share - 1) * kept["yaw"])
        )
        for share in (0, 1)
    )
    assert end.x - home.x <= far_x + 1e-6 and end.y - home.y <= far_y + 1e-6
    assert max(abs(home.yaw), abs(end.yaw)) <= math.radians(turn) + 1e-6
    assert kept["speed"] * max(x, y) <= speed + 1e-6
    low, high = true_box(flags)
    for corner in (low, high):
        told = conversion.to_firmware(corner)
        assert HOME.x - 1e-9 <= told.x <= HOME.x + kept["x"] + 1e-9
        assert HOME.y - 1e-9 <= told.y <= HOME.y + kept["y"] + 1e-9
        assert abs(told.yaw) <= kept["yaw"] + 1e-9 and told.yaw >= HOME.yaw - 1e-9
    motion = motion_limits(flags)
    assert motion.speed <= speed + 1e-6
    assert max(map(abs, conversion.velocity(motion.speed, motion.speed, 0)[:2])) <= kept["speed"] + 1e-9


def test_the_yaw_of_a_circle_has_an_offset_only() -> None:
    conversion = conversion_of(flags_of("--kind=circle", "--offset-yaw=102.5"))
    assert conversion.scale["yaw"] == 1
    assert conversion.to_firmware(Position(0, 0, math.radians(-178))).yaw == pytest.approx(math.radians(-173.5))
    assert conversion.to_firmware(Position(0, 0, math.radians(178))).yaw == pytest.approx(math.radians(-177.5))
    assert conversion.to_true(Position(0, 0, -math.pi)).yaw == pytest.approx(math.radians(175.5))
    assert conversion.limit_to_firmware("yaw", CIRCLE_YAW) == CIRCLE_YAW
    for words in (("--kind=circle", "--steps-yaw=0.55"), ("--kind=circle", "--offset-yaw=83"), ("--offset-yaw=100",)):
        with pytest.raises(PortError, match=r"circle has no steps|expected 89 to 111|expected 72 to 94"):
            conversion_of(flags_of(*words))
