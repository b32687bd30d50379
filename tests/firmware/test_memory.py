"""Limits in the rig's memory: what is taken and when, what holds, and what is left of a write that was cut."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.gantry.rig_table import BOUNDS, CIRCLE_YAW, LIMITS, Error, Source, Status
from tests.firmware.conftest import CLOSE
from tests.firmware.programs import Bench, Rig

WIDEST = tuple(widest for _, widest in LIMITS.values())
NARROWEST = tuple(narrowest for narrowest, _ in LIMITS.values())
TIGHT = (1.2, 0.9, 1.5, 0.4, 0.5, 0.25, 0.5)
OTHER = (1.5, 1.0, 2.0, 0.6, 1.0, 0.3, 1.0)
FIRST, SIZE, COPIES = 32, 32, 2
"""Of the memory: where the first copy is, and its bytes."""
WRITES = COPIES * (SIZE + 1)


def kept(bench: Bench | Rig) -> tuple[tuple[float, ...], Source]:
    """The limits that the rig says, and where they are from."""
    answer = bench.ask("$LIMITS")
    assert answer.startswith("$LIMITS:")
    *numbers, source = answer.removeprefix("$LIMITS:").split(",")
    return tuple(map(float, numbers)), Source(int(source))


def line(limits: tuple[float, ...]) -> str:
    return "$SETLIMITS:" + ",".join(f"{limit:g}" if limit < 2.9 else f"{limit:.6f}" for limit in limits)


def keep(bench: Bench | Rig, limits: tuple[float, ...]) -> None:
    """Write limits as the service does."""
    assert bench.send_line("$STOP") == bench.send_line("$FORGET") == bench.send_line(line(limits)) == []
    assert kept(bench) == (pytest.approx(limits), Source.WRITING)
    bench.run(0.5)
    assert kept(bench) == (pytest.approx(limits), Source.KEPT)


def cut(bench: Bench, limits: tuple[float, ...], writes: int) -> tuple[tuple[float, ...], Source]:
    """What the rig says after a loss of power in the midst of writing limits."""
    bench.command(f"memory cut {writes}")
    bench.send_line("$FORGET")
    assert bench.send_line(line(limits)) == []
    bench.run(0.0034 * writes + 0.01)
    bench.command("restart")
    return kept(bench)


@pytest.fixture
def tight(bench_program: Path) -> Iterator[Bench]:
    """A rig with limits in its memory, calibrated and in the middle of what is left."""
    with Bench(bench_program, CLOSE) as bench:
        keep(bench, TIGHT)
        bench.calibrate()
        bench.go(-0.3, -0.2, 0)
        bench.extremes()
        yield bench


@pytest.mark.parametrize("which", range(len(LIMITS)), ids=list(LIMITS))
def test_limits_beyond_what_is_built_are_refused(fresh: Bench, which: int) -> None:
    for limit in (WIDEST[which] + 1e-6, NARROWEST[which] - 1e-6, 0.0, -1.0):
        beyond = ",".join(f"{limit if i == which else one:.6f}".rstrip("0") + "0" for i, one in enumerate(TIGHT))
        assert fresh.send_line(f"$SETLIMITS:{beyond}"[:64]) == [f"$ERROR:{int(Error.BOUNDS)}"]
    fresh.run(0.5)
    assert kept(fresh) == (pytest.approx(WIDEST), Source.BUILT)


def test_limits_change_only_while_the_rig_stands_and_does_not_know_its_home(bench: Bench) -> None:
    busy = [f"$ERROR:{int(Error.BUSY)}"]
    assert bench.send_line(line(TIGHT)) == busy
    bench.keep_running("0.1,0,0", 0.3)
    assert bench.send_line("$FORGET") == bench.send_line(line(TIGHT)) == busy
    bench.send_line("$STOP")
    assert bench.send_line("$FORGET") == busy, "it brakes"
    bench.until(Status.IDLE)
    assert bench.send_line("$FORGET") == []
    assert bench.status() == Status.NOT_CALIBRATED
    bench.send_line("$CALIBRATE")
    assert bench.send_line("$FORGET") == bench.send_line(line(TIGHT)) == [f"$ERROR:{int(Error.HOMING)}"]
    bench.send_line("$STOP")
    bench.run(0.5)
    assert kept(bench) == (pytest.approx(WIDEST), Source.BUILT)
    assert bench.send_line(line(TIGHT)) == []
    for text in ("$CALIBRATE", line(OTHER), "$FORGET"):
        assert bench.send_line(text) == busy, "it writes"
    bench.run(0.5)
    assert kept(bench) == (pytest.approx(TIGHT), Source.KEPT)


def test_nothing_of_a_trouble_is_lost_by_new_limits(bench: Bench) -> None:
    bench.command("switch x closed")
    bench.run(0.1)
    assert bench.status() == Status.LIMIT
    assert bench.send_line(line(TIGHT)) == bench.send_line("$FORGET") == [f"$ERROR:{int(Error.TROUBLE)}"]


@pytest.mark.thorough
def test_the_range_holds(tight: Bench) -> None:
    ends = {"x": BOUNDS["x"][0] + TIGHT[0], "y": BOUNDS["y"][0] + TIGHT[1], "yaw": TIGHT[2]}
    for axis, end in ends.items():
        places = {"x": "-0.3", "y": "-0.2", "yaw": "0"}
        assert tight.send_line(f"$GOTO:{','.join((places | {axis: f'{end + 0.00002:.6f}'}).values())}") == [
            f"$ERROR:{int(Error.BOUNDS)}"
        ]
    assert tight.send_line(f"$GOTO:-0.3,-0.2,{-TIGHT[2] - 0.00002:.6f}") == [f"$ERROR:{int(Error.BOUNDS)}"]
    tight.keep_running("0.3,0.3,0.4", 6)
    tight.run(0.1)
    pose = tight.pose()
    for axis, end in ends.items():
        assert pose[axis] == pytest.approx(end, abs=0.012 if axis == "yaw" else 0.006) and pose[axis] <= end + 1e-3
    assert tight.status() in (Status.IDLE, Status.MOVING)


@pytest.mark.thorough
def test_the_speed_and_the_acceleration_hold_of_run_and_goto(tight: Bench) -> None:
    assert (
        tight.send_line("$RUN:0.400001,0,0") == tight.send_line("$RUN:0,0,0.500001") == [f"$ERROR:{int(Error.BOUNDS)}"]
    )
    tight.keep_running("-0.4,0.4,0.5", 1.8)
    tight.send_line("$STOP")
    tight.until(Status.IDLE)
    tight.go(-0.85, 0.15, -1.4)
    tight.go(0.25, -0.65, 1.4)
    found = tight.extremes()
    assert all(0.9 * limit < speed <= limit for speed, limit in zip(found["speed"], (0.4, 0.4, 0.5), strict=True))
    assert all(ramp <= limit for ramp, limit in zip(found["ramp"], (0.25, 0.25, 0.5), strict=True))
    assert tight.happened("slip") == []


@pytest.mark.thorough
def test_a_limit_between_what_the_driver_knows_is_no_fault(fresh: Bench) -> None:
    keep(fresh, (*WIDEST[:4], 0.9, 0.5, 0.9))
    fresh.calibrate()
    fresh.keep_running("0,0,0.9", 2)
    assert fresh.status() == Status.MOVING
    assert 0.45 < fresh.extremes()["speed"][2] <= 0.5


def test_limits_outlast_a_reset_with_the_position(tight: Bench) -> None:
    tight.command("restart")
    tight.run(0.1)
    assert kept(tight) == (pytest.approx(TIGHT), Source.KEPT)
    tight.send_line("$STOP")
    assert tight.status() == Status.IDLE
    assert tight.send_line("$RUN:0.41,0,0") == [f"$ERROR:{int(Error.BOUNDS)}"]


@pytest.mark.parametrize("before", [None, OTHER], ids=["none", "others"])
@pytest.mark.thorough
def test_a_write_that_is_cut_leaves_the_limits_from_before_or_the_new_ones(
    fresh: Bench, before: tuple[float, ...] | None
) -> None:
    old = (pytest.approx(before or WIDEST), Source.KEPT if before else Source.BUILT)
    seen = []
    for writes in range(WRITES + 1):
        fresh.command("memory cut 1000000")
        fresh.command("memory blank")
        fresh.command("restart")
        if before:
            keep(fresh, before)
        found = cut(fresh, TIGHT, writes)
        assert found in (old, (pytest.approx(TIGHT), Source.KEPT)), f"cut in write {writes}"
        seen.append(found == old)
    assert seen[0] and not seen[-1] and seen == sorted(seen, reverse=True)


@pytest.mark.parametrize("before", [None, WIDEST], ids=["none", "wider"])
@pytest.mark.thorough
def test_writes_that_are_cut_one_after_the_other_leave_the_limits_from_before_or_the_new_ones(
    fresh: Bench, before: tuple[float, ...] | None
) -> None:
    """The first cut is between the copies: they differ, or one is still blank, when the second write begins."""
    new = (pytest.approx(OTHER), Source.KEPT)
    half = WRITES // 2
    for first, second in itertools.product((half - 9, half, half + 1, half + 9, WRITES), (2, 20, half + 2, half + 20)):
        fresh.command("memory cut 1000000")
        fresh.command("memory blank")
        fresh.command("restart")
        if before:
            keep(fresh, before)
        limits, source = cut(fresh, TIGHT, first)
        fresh.command("memory cut 1000000")
        assert cut(fresh, OTHER, second) in ((pytest.approx(limits), source), new), f"cuts in writes {first}, {second}"


def test_any_damage_of_one_copy_is_harmless(fresh: Bench) -> None:
    keep(fresh, TIGHT)
    for at in range(FIRST, FIRST + COPIES * SIZE):
        fresh.command(f"memory flip {at} {1 << at % 8}")
        fresh.command("restart")
        assert kept(fresh) == (pytest.approx(TIGHT), Source.KEPT)
        fresh.command(f"memory flip {at} {1 << at % 8}")


@pytest.mark.parametrize("at", [0, 1, 2, 12, 29, 30, 31])
@pytest.mark.thorough
def test_damage_of_both_copies_leaves_the_narrowest_limits_and_no_position(tight: Bench, at: int) -> None:
    for copy in range(COPIES):
        tight.command(f"memory flip {FIRST + copy * SIZE + at} 4")
    tight.command("restart")
    assert kept(tight) == (pytest.approx(NARROWEST), Source.DAMAGED)
    assert tight.status() == Status.NOT_CALIBRATED
    tight.calibrate()
    assert tight.send_line("$RUN:0.11,0,0") == [f"$ERROR:{int(Error.BOUNDS)}"]
    assert tight.send_line("$GOTO:-0.79,-0.65,0") == [f"$ERROR:{int(Error.BOUNDS)}"]
    tight.go(-0.85, -0.65, 0)
    keep(tight, TIGHT)


def checksum(data: bytes) -> int:
    """The part of the checksum that changes with these differences of a record."""
    found = 0
    for byte in data:
        found ^= byte << 8
        for _ in range(8):
            found = (found << 1 ^ (0x1021 if found & 0x8000 else 0)) & 0xFFFF
    return found


def test_limits_of_another_kind_of_rig_are_not_taken(fresh: Bench) -> None:
    keep(fresh, TIGHT)
    off = checksum(bytes((0, 1)) + bytes(SIZE - 4))
    for copy in range(COPIES):
        for at, bits in ((1, 1), (SIZE - 2, off & 0xFF), (SIZE - 1, off >> 8)):
            fresh.command(f"memory flip {FIRST + copy * SIZE + at} {bits}")
    fresh.command("restart")
    assert kept(fresh) == (pytest.approx(NARROWEST), Source.DAMAGED)


def test_a_memory_that_does_not_take_its_limits_says_so(fresh: Bench) -> None:
    fresh.command("memory cut 50")
    assert fresh.send_line(line(TIGHT)) == []
    fresh.run(0.5)
    assert kept(fresh) == (pytest.approx(NARROWEST), Source.DAMAGED)


@pytest.mark.thorough
def test_a_rig_that_turns_without_end_keeps_limits_but_none_of_its_yaw(circle: Bench) -> None:
    limits = (1.2, 0.9, CIRCLE_YAW, 0.4, 0.5, 0.25, 0.5)
    assert kept(circle) == (pytest.approx((*WIDEST[:2], CIRCLE_YAW, *WIDEST[3:])), Source.BUILT)
    circle.send_line("$FORGET")
    assert circle.send_line(line(TIGHT)) == [f"$ERROR:{int(Error.BOUNDS)}"]
    keep(circle, limits)
    circle.calibrate()
    circle.extremes()
    circle.go(-0.3, -0.2, 3.0)
    circle.keep_running("0,0,-0.5", 8)
    assert 0.45 < circle.extremes()["speed"][2] <= 0.5
    circle.send_line("$STOP")
    circle.until(Status.IDLE)
    circle.calibrate()
    circle.run(0.3)
    assert circle.is_true()


def test_the_emulated_rig_keeps_its_memory_without_power(new_rig: Rig) -> None:
    assert kept(new_rig) == (pytest.approx(WIDEST), Source.BUILT)
    keep(new_rig, TIGHT)
    new_rig.close()
    new_rig.command("unplug power")
    new_rig.run(0.2)
    new_rig.plug()
    new_rig.open()
    assert kept(new_rig) == (pytest.approx(TIGHT), Source.KEPT)


def test_a_plug_that_is_pulled_while_the_emulated_rig_writes_leaves_the_limits_from_before(firmware: None) -> None:
    with Rig() as rig:
        rig.open()
        keep(rig, OTHER)
        assert rig.send_line(line(TIGHT)) == []
        rig.close()
        rig.command("unplug power")
        rig.run(0.3)
        rig.plug()
        rig.open()
        assert kept(rig) == (pytest.approx(OTHER), Source.KEPT)
        assert rig.status() == Status.NOT_CALIBRATED
