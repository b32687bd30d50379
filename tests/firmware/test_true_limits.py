"""The emulated rig that differs from the firmware's constants: by measured ones it stays within true limits."""

import math

import pytest

from services.gantry.memory import wanted
from services.gantry.motion import AxisConstants, Conversion
from services.gantry.protocol import Position
from services.gantry.rig_table import BOUNDS, CIRCLE_OFFSET, CIRCLE_STEPS, OFFSETS, STEPS
from tests.firmware.programs import CIRCLE_ELF, Rig

X, Y, YAW, SPEED, RATE = 0.5, 0.4, 0.7, 0.3, 0.8
TEXT = f"x={X},y={Y},yaw={YAW},speed={SPEED},yaw-rate={RATE},acceleration=0.4"


def measured(scale: tuple[float, float, float], shift: tuple[float, float, float]) -> Conversion:
    """What a perfect measurement of such a rig gives; shifts in m, m, degrees."""
    found = {}
    for (axis, steps), s, d in zip(STEPS.items(), scale, shift, strict=True):
        per_rad = math.degrees(1) if axis == "yaw" else 1.0
        found[axis] = AxisConstants(steps / s * per_rad, OFFSETS[axis] - d * steps / s)
    return Conversion(found)


@pytest.mark.parametrize(
    ("scale", "shift"),
    [((1.08, 0.93, 1.05), (0.02, -0.03, 6.0)), ((0.92, 1.06, 0.94), (-0.02, 0.03, -8.0))],
)
def test_true_limits_hold_on_a_rig_with_other_constants(
    firmware: None, scale: tuple[float, float, float], shift: tuple[float, float, float]
) -> None:
    conversion = measured(scale, shift)
    kept = wanted(TEXT, conversion)
    home = conversion.to_true(Position(*(BOUNDS[axis][0] for axis in ("x", "y", "yaw"))))
    words = "--scale", ",".join(map(str, scale)), "--shift", ",".join(map(str, shift))
    with Rig(*words) as rig:
        rig.open()
        assert rig.send_line("$SETLIMITS:" + ",".join(f"{value:.4f}" for value in kept.values())) == []
        rig.run(0.5)
        rig.calibrate()
        rig.go(-0.7, -0.5, 0.0)  # homing is where the yaw's limit does not reach
        seen: dict[str, list[float]] = {"x": [], "y": [], "yaw": [], "v": [], "w": []}
        for sign in (1, -1):
            v, w = f"{sign * kept['speed']:.6f}", f"{sign * kept['yaw-rate']:.6f}"
            for _ in range(16):
                assert rig.send_line(f"$RUN:{v},{v},{w}") == []
                rig.run(0.2)
                pose = rig.pose()
                for axis in ("x", "y", "yaw"):
                    seen[axis].append(pose[axis])
                seen["v"] += [abs(pose["vx"]), abs(pose["vy"])]
                seen["w"].append(abs(pose["vyaw"]))
            rig.run(1.2)
            rig.send_line("$STOP")
    for axis, end in {"x": home.x + X, "y": home.y + Y}.items():
        assert end - 0.03 < max(seen[axis]) < end + 1e-3, axis
    assert YAW - 0.05 < max(map(abs, seen["yaw"])) < YAW + 1e-3
    assert 0.8 * SPEED < max(seen["v"]) < 1.02 * SPEED and max(seen["w"]) < 1.02 * RATE


def test_the_yaw_of_a_circle_goes_to_true_headings(firmware: None) -> None:
    degrees = -4.5
    offset = CIRCLE_OFFSET - degrees * CIRCLE_STEPS / 360
    conversion = Conversion({"yaw": AxisConstants(CIRCLE_STEPS / math.tau, offset)}, circle=True)
    words = "--kind", "circle", "--shift", f"0,0,{degrees}"
    with Rig(*words, place=(-0.85, -0.65, -170.0), elf=CIRCLE_ELF) as rig:
        rig.open()
        rig.calibrate()
        for heading in (178.0, -178.0):
            told = conversion.to_firmware(Position(-0.8, -0.6, math.radians(heading)))
            rig.go(told.x, told.y, told.yaw)
            off = math.remainder(rig.pose()["yaw"] - math.radians(heading), math.tau)
            assert abs(math.degrees(off)) < 0.1
            reported = conversion.to_true(Position(*rig.position()))
            assert math.remainder(reported.yaw - rig.pose()["yaw"], math.tau) == pytest.approx(0, abs=3e-4)
