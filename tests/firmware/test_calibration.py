"""The emulated rig with wrong constants: what its readings give, and where it goes with that."""

import math

import pytest

from dodo_dsl.calibration.axis_line import AXES, Reading, fit
from services.gantry.conversion import AxisConstants, Conversion
from services.gantry.protocol import Position
from services.gantry.rig_table import MICROSTEP
from tests.firmware.programs import Rig

SCALE, SHIFT = (1.03, 0.97, 1.01), (0.007, -0.005, 2.0)


def words(numbers: "tuple[float, ...]") -> str:
    return ",".join(map(str, numbers))


def test_constants_from_readings_are_true_to_a_microstep(firmware: None) -> None:
    readings: dict[str, list[Reading]] = {name: [] for name in AXES}
    with Rig("--scale", words(SCALE), "--shift", words(SHIFT)) as rig:
        rig.open()
        rig.calibrate()
        for share in (-0.75, -0.25, 0.25, 0.75):
            rig.go(0.9 * share, 0.7 * share, 2.6 * share)
            steps, pose = Conversion().steps(Position(*rig.position())), rig.pose()
            pose["yaw"] = math.degrees(pose["yaw"])
            for name, found in readings.items():
                found.append(Reading(steps[name], pose[name]))
        lines = {name: fit(AXES[name], found) for name, found in readings.items()}
        per_rad = {"x": 1.0, "y": 1.0, "yaw": math.degrees(1)}
        measured = Conversion({n: AxisConstants(line.steps * per_rad[n], line.offset) for n, line in lines.items()})
        for place in (Position(0.9, 0.6, 2.9), Position(-0.9, -0.65, -2.5)):
            told = measured.to_firmware(place)
            rig.go(told.x, told.y, told.yaw)
            pose = rig.pose()
            off = {name: abs(pose[name] - getattr(place, name)) for name in AXES}
            assert all(off[name] <= MICROSTEP[name] * scale + 1e-6 for name, scale in zip(AXES, SCALE, strict=True)), (
                off
            )
            assert math.degrees(off["yaw"]) < 0.1
    constants = {name: (line.steps, line.offset) for name, line in lines.items()}
    for (name, (c, offset)), scale, shift in zip(constants.items(), SCALE, SHIFT, strict=True):
        built_in = Conversion().steps(Position(0, 0, 0))[name]
        assert c == pytest.approx({"x": 3320, "y": 3320, "yaw": 0.55}[name] / scale, rel=3e-5)
        assert offset == pytest.approx(built_in - shift * c, abs=0.01)
