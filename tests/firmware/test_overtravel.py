"""A counter that is far off at speed: the switch closes, the motor slips, and what is behind the switch has to do."""

import pytest

from services.gantry.rig_table import BOUNDS, MICROSTEP, SPEED, Status
from tests.firmware.programs import Bench

AXES = {"x": ("x",), "y": ("y1", "y2"), "yaw": ("alpha",)}
SAFE = 0.4
"""m/s, from which 15 mm behind a switch are enough (firmware/README.md)."""
OFF = {"x": 3.0, "y": 3.0, "yaw": 3.2}
"""m or rad that a counter is off."""


def drive_into_switch(bench: Bench, axis: str, far: bool, speed: float) -> float:
    """From the other end, while the counter shows room; the highest true speed."""
    sign, index = (1 if far else -1), list(AXES).index(axis)
    goal, velocity = [0.0, 0.0, 0.0], ["0", "0", "0"]
    goal[index], velocity[index] = BOUNDS[axis][not far] + sign * 0.02, f"{sign * speed}"
    bench.go(*goal)
    for motor in AXES[axis]:
        bench.command(f"miscount {motor} {sign * OFF[axis] / (128 * MICROSTEP[axis]):.0f}")
    fastest = 0.0
    for _ in range(600):
        bench.send_line(f"$RUN:{','.join(velocity)}")
        bench.run(0.02)
        fastest = max(fastest, abs(bench.pose()[f"v{axis}"]))
        if bench.status() == Status.LIMIT:
            return fastest
    raise AssertionError("no switch closed")


def recovers(bench: Bench) -> bool:
    """CALIBRATE leads out from behind a switch, and home is where it was."""
    bench.run(0.5)
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED
    bench.calibrate()
    bench.run(0.3)
    return bench.is_true()


@pytest.mark.parametrize("far", [True, False], ids=["far", "home"])
@pytest.mark.parametrize(("axis", "speed"), [("x", SAFE), ("y", SAFE), ("yaw", SPEED["yaw"])])
@pytest.mark.thorough
def test_up_to_this_speed_the_frame_is_not_hit(bench: Bench, axis: str, speed: float, far: bool) -> None:
    assert drive_into_switch(bench, axis, far, speed) == pytest.approx(speed, rel=0.15)
    bench.run(0.5)
    assert bench.happened("crash") == []
    assert recovers(bench)


@pytest.mark.parametrize("far", [True, False], ids=["far", "home"])
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.thorough
def test_at_full_speed_the_frame_is_hit_and_reported(bench: Bench, axis: str, far: bool) -> None:
    """A hard stop from 1 m/s makes the motor slip; friction alone needs 83 mm and not 15."""
    assert drive_into_switch(bench, axis, far, SPEED[axis]) > 0.99
    bench.run(0.5)
    crashes = bench.happened("crash")
    assert {one["motor"] for one in crashes} == set(AXES[axis])
    assert all(0.8 < one["value"] < 0.95 for one in crashes)
    assert recovers(bench)
