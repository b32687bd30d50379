"""CALIBRATE, and what a reset leaves of it."""

from pathlib import Path

import pytest

from services.gantry.rig_table import MICROSTEP, Error, Status
from tests.firmware.programs import Bench

HOME = (-0.9, -0.7, -2.63386)


@pytest.mark.thorough
def test_home_is_where_the_switches_open(fresh: Bench) -> None:
    fresh.send_line("$CALIBRATE")
    assert fresh.status() == Status.HOMING
    assert fresh.send_line("$POSITION") == [f"$ERROR:{int(Error.UNCALIBRATED)}"]
    fresh.until(Status.IDLE)
    assert fresh.position() == pytest.approx(HOME, abs=1e-5)
    fresh.run(0.3)
    assert fresh.is_true()
    assert fresh.extremes()["speed"][0] <= 0.11
    assert fresh.happened("crash") == [] and fresh.happened("slip") == []


@pytest.mark.parametrize(
    "place",
    [(-0.9012, -0.7012, -152.0), (0.9553, 0.7053, 171.6), (0.9553, -0.7012, 0.0), (0.0, 0.7053, -152.0)],
    ids=["home", "far end", "mixed", "some"],
)
@pytest.mark.thorough
def test_it_finds_home_from_a_closed_switch_at_either_end(bench_program: Path, place: tuple[float, ...]) -> None:
    with Bench(bench_program, (place[0], place[1], place[2])) as bench:
        bench.calibrate()
        bench.run(0.3)
        assert bench.is_true()
        assert bench.happened("crash") == []


@pytest.mark.parametrize("shift", range(6))
def test_home_is_found_from_anywhere_though_switches_bounce(bench_program: Path, shift: int) -> None:
    """Wherever an axis starts, the switches bounce for some milliseconds at any phase of the firmware's looks."""
    place = (-0.85 + 0.00017 * shift, -0.6 + 0.00023 * shift, -140 + 0.13 * shift)
    with Bench(bench_program, place) as bench:
        bench.calibrate()
        bench.run(0.3)
        assert bench.is_true()
        edges = [one["event"] for one in bench.events if one["event"] in ("open", "closed") and one["motor"] == "x"]
        assert len(edges) > 10
        bench.watch(0.4)
        assert bench.status() == Status.IDLE


@pytest.mark.parametrize("beyond", [1, 3, 9, 20])
def test_a_rotor_may_stand_between_two_poles_when_drivers_reset(bench: Bench, beyond: int) -> None:
    """So it falls to either side, and has to rest there before the field sets off, or it loses a turn of four steps."""
    half_turn = round((0.9 + 0.1) / MICROSTEP["x"] / 512) * 512 - 256
    bench.go(-0.9 + (half_turn + beyond) * MICROSTEP["x"], -0.7 + (half_turn - beyond) * MICROSTEP["y"], 0)
    bench.calibrate()
    bench.run(0.3)
    assert bench.is_true()
    assert bench.happened("slip") == []


def test_a_pair_that_is_far_from_square_is_not_torn_on(fresh: Bench) -> None:
    fresh.command("push y1 80")
    fresh.run(0.1)
    fresh.send_line("$CALIBRATE")
    fresh.until(Status.FAULT)
    assert abs(fresh.pose()["skew"]) < 0.03


@pytest.mark.thorough
@pytest.mark.parametrize("motor", ["x", "y1", "y2", "alpha"])
@pytest.mark.parametrize("stuck", ["open", "closed"])
def test_a_stuck_switch_is_a_fault_and_not_a_crash_with_force(bench: Bench, motor: str, stuck: str) -> None:
    """An open one is noticed at the frame, at homing speed, and by the way; a closed one before anything goes far."""
    bench.go(-0.5, -0.4, -2)
    bench.command(f"switch {motor} {stuck}")
    bench.extremes()
    bench.send_line("$CALIBRATE")
    passed = 0.0
    while (status := bench.status()) == Status.HOMING:
        assert passed < 60
        bench.run(0.4)
        passed += 0.4
    assert status in (Status.FAULT, Status.STALL)
    assert all(one["value"] <= 0.4 for one in bench.happened("crash"))
    if stuck == "closed":
        assert max(bench.extremes()["way"][:2]) < 0.02
    bench.run(1)
    assert not bench.pose()["moves"]
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED


@pytest.mark.thorough
def test_a_belt_that_is_off_is_noticed_by_the_way(fresh: Bench) -> None:
    fresh.command("tear x")
    fresh.send_line("$CALIBRATE")
    fresh.until(Status.FAULT)
    assert 1.85 < fresh.extremes()["way"][0] < 1.9


@pytest.mark.thorough
def test_an_axis_that_never_arrives_is_a_fault(fresh: Bench) -> None:
    """Neither its switch nor its counter shows how far it is."""
    fresh.command("tear x")
    fresh.command("freeze x on")
    fresh.send_line("$CALIBRATE")
    passed = fresh.until(Status.FAULT)
    assert 30 <= passed <= 33
    fresh.run(1)
    assert not fresh.pose()["moves"]
    fresh.send_line("$STOP")
    assert fresh.status() == Status.NOT_CALIBRATED


@pytest.mark.thorough
def test_a_switch_that_closed_by_mistake_is_not_home(fresh: Bench) -> None:
    fresh.send_line("$CALIBRATE")
    fresh.watch(1)
    fresh.command("switch x closed")
    fresh.run(0.01)
    fresh.command("switch x works")
    fresh.run(0.2)
    before = fresh.pose()["x"]
    fresh.until(Status.FAULT)
    fresh.run(0.1)
    assert fresh.pose()["x"] == pytest.approx(before, abs=1e-4)


def test_only_stop_ends_it_early(fresh: Bench) -> None:
    fresh.send_line("$CALIBRATE")
    fresh.watch(1)
    for line in ("$RUN:0.1,0,0", "$GOTO:0,0,0", "$CALIBRATE"):
        assert fresh.send_line(line) == [f"$ERROR:{int(Error.HOMING)}"]
    fresh.send_line("$STOP")
    fresh.run(1)
    assert fresh.status() == Status.NOT_CALIBRATED
    assert not fresh.pose()["moves"]


def test_a_reset_takes_up_the_position_of_the_drivers(bench: Bench) -> None:
    bench.keep_running("0.3,-0.2,0.4", 0.6)
    bench.command("restart")
    bench.run(1.2)
    assert bench.status() == Status.IDLE
    assert not bench.pose()["moves"]
    bench.run(0.2)
    assert bench.is_true()
    assert max(bench.extremes()["ramp"][:2]) <= 0.5


@pytest.mark.parametrize("what", ["homing", "power", "stall"])
def test_a_reset_does_not_trust_a_position_that_is_void(bench: Bench, what: str) -> None:
    if what == "homing":
        bench.send_line("$CALIBRATE")
        bench.watch(1)
    elif what == "power":
        bench.command("motors off")
        bench.command("motors on")
    else:
        bench.command("push x 8")
        bench.run(0.1)
    bench.command("restart")
    bench.run(0.5)
    assert bench.status() == Status.NOT_CALIBRATED


@pytest.mark.thorough
@pytest.mark.parametrize("line", ["$RUN:0.2,0,0", "$GOTO:0.3,0,0"])
@pytest.mark.parametrize("notice", ["$STOP", "$CALIBRATE"])
def test_after_a_reset_nobody_continues_unaware(bench: Bench, line: str, notice: str) -> None:
    """The master of before goes on with its lines, and does not look at the status."""
    bench.keep_running("0.2,0,0", 0.6)
    bench.command("restart")
    for _ in range(20):
        assert bench.send_line(line) == [f"$ERROR:{int(Error.RESTARTED)}"]
        bench.run(0.05)
    assert bench.status() == Status.IDLE
    assert not bench.pose()["moves"]
    bench.send_line(notice)
    bench.until(Status.IDLE)
    assert bench.send_line(line) == []
