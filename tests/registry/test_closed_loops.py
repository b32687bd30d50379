"""The worlds of closed loops that ship or that `dodo new` writes: closed, and passed by no program that does not look.

With DoDo's own services for vehicle, pose, other cars and verdict, in test time and without a bus; the integrator
stands for a rig's gantry, which follows the vehicle a little later. No world refutes a schedule that was made for it,
with enough segments: a straight track takes two, and the others more than the search finds.
"""

import math
import random
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

import cv2
import numpy as np
import pytest
import shapely

from dodo_dsl import compiler, package_data
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.opendlv.assets.track import load_obstacles
from services.base import Verdict
from tests.emit.readers import run
from tests.services.built import MESSAGES, built

Program = Callable[[float], tuple[float, float]]
"""Steering (rad) and pedal by the time in s."""
NAMES = [
    *("sil-closed-straight", "sil-closed-left-curve", "sil-closed-kiwi-track", "sil-closed-two-cars"),
    *("hil-dynamic", "hil-closed-oval", "sil-first"),
]
BENDS = ("sil-closed-left-curve", "sil-closed-kiwi-track", "sil-closed-two-cars", "hil-closed-oval")
TICK, FRAME = 10_000, 100_000  # us
MODULES = {name: name.replace("-", "_") for name in ("dynamic-model", "integrator", "beacon", "collision")}
MODULES["gantry"], OF_GANTRY = "integrator", ("x", "y", "yaw", "frame-id")
REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")


def segments(*parts: tuple[float, float, float]) -> Program:
    """Steering and pedal until a time, and so on; the last for ever."""
    return lambda time: next(((s, p) for until, s, p in parts if time < until), parts[-1][1:])


def drawn(seed: int, least: int, most: int) -> Program:
    """Segments of random lengths, steering and pedals."""
    dice = random.Random(seed)
    times = sorted(dice.uniform(0, 12) for _ in range(dice.randint(least, most)))
    pedal = dice.uniform(0.03, 0.14)
    return segments(*((time, dice.uniform(-0.29, 0.29), pedal) for time in times))


def constant(steering: float, pedal: float = 0.08) -> Program:
    return lambda _: (steering, pedal)


PROGRAMS: dict[str, Program] = {
    **{f"steering {s}": constant(s) for s in (-0.1, 0.0, 0.006, 0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.16)},
    **{f"pedal {p}": constant(0.06, p) for p in (0.03, 0.14)},
    "backwards": constant(0.0, -0.3),
    "backwards, in a bend": constant(0.2, -0.5),
    "out behind the start, and around": segments(
        (1.6, 0.0, -0.6), (6.0, 0.29, 0.1), (9.0, -0.29, 0.1), (99.0, 0.0, 0.1)
    ),
    "wave": lambda time: (0.15 * math.sin(3 * time), 0.08),
    "from wall to wall": lambda time: (0.2 if time % 2 < 1 else -0.2, 0.1),
    "stop and go": lambda time: (0.05, 0.1 if time % 4 < 2 else 0.0),
    **{f"random {seed}": drawn(seed, 5, 40) for seed in range(3)},
}


@pytest.fixture(scope="module")
def tests(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ResolvedTest]:
    found = {test.spec.slug: test for test in compiler.load([package_data.registry()]).tests}
    folder = tmp_path_factory.mktemp("new")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("new", "--application")[0] == 0
        (found["sil-first"],) = compiler.load([], start=folder).tests
    for example in ("wheels", "ranges"):
        (test,) = compiler.load([], start=package_data.root() / "examples" / example).tests
        found[test.spec.slug] = test
    return found


def drive(test: ResolvedTest, program: Program) -> Verdict:
    """The verdict on a program, whose requests for a frame hold until those for the next."""
    with ExitStack() as stack:
        world = []
        for service in test.services:
            name, texts = service.manifest.name, {k: v.value for k, v in service.arguments.items() if v.value}
            given = {k: v for k, v in texts.items() if name != "gantry" or k in OF_GANTRY}
            flags = [f"--{key}={value.path or value.text}" for key, value in given.items()]
            world += [stack.enter_context(built(MODULES[name], *flags))] if name in MODULES else []
        *movers, judge = world
        by_wheels = (REQUESTS[1], 1) in movers[0].inputs
        for each in world:
            each.begin(0)
        for now in range(0, 100 * 1_000_000, TICK):
            if now % FRAME == 0:
                steering, pedal = program(now / 1e6)
                if by_wheels:
                    hand(world, REQUESTS[1], 0, now, position=5 * pedal - steering)
                    hand(world, REQUESTS[1], 1, now, position=5 * pedal + steering)
                else:
                    hand(world, REQUESTS[0], 0, now, groundSteering=steering)
                    hand(world, REQUESTS[1], 0, now, position=pedal)
            for mover in movers:
                for message, stamp, _ in mover.update(now):
                    give(movers if now % FRAME else world, message, stamp, now)
            judge.update(now)
            if judge.verdict is not None:
                return judge.verdict
    raise AssertionError("no verdict came")


def hand(services: Sequence[Any], name: str, stamp: int, now: int, **fields: float) -> None:
    give(services, MESSAGES.type(name)(**fields), stamp, now)


def give(services: Sequence[Any], message: Any, stamp: int, now: int) -> None:
    for each in services:
        name = message.DESCRIPTOR.full_name
        if handler := each.inputs.get((name, stamp)) or each.inputs.get((name, None)):
            handler(message, now)


@pytest.mark.thorough
@pytest.mark.parametrize("name", [*NAMES, "sil-two-wheels", "sil-closed-corridor"])
def test_a_track_has_no_way_out_and_none_round_to_its_goal(tests: dict[str, ResolvedTest], name: str) -> None:
    """On a grid of 1 cm, along which a thing of 4 cm moves wherever no wall is."""
    given = {s.manifest.name: s.arguments for s in tests[name].services}
    track, pose = given["collision"], given.get("integrator") or given["gantry"]
    lines = load_obstacles(track["map-path"].value.path)
    goal, gates, walls = (track[key].text.split(",") for key in ("goal", "gates", "walls"))
    walls = [each for each in lines if each not in (*goal, *gates)] if walls == ["*"] else walls
    west, south, east, north = (round(value * 100) for value in shapely.total_bounds(list(lines.values())))
    x, y = np.meshgrid(np.arange(west - 30, east + 30) / 100, np.arange(south - 30, north + 30) / 100)

    def parts(names: list[str]) -> Any:
        """The number of the part of the ground in which each point of the grid is."""
        barriers = shapely.union_all([lines[each] for each in names])
        shapely.prepare(barriers)
        free = shapely.distance(barriers, shapely.points(x, y)) > 0.02
        return cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]

    def at(found: Any, place: Sequence[float]) -> int:
        return int(found[round(place[1] * 100) - south + 30, round(place[0] * 100) - west + 30])

    start = [float(pose[key].text) for key in ("x", "y")]
    inside = parts(walls)
    assert at(inside, start) != inside[0, 0] > 0
    (x1, y1), (x2, y2) = lines[goal[0]].geoms[0].coords
    across = np.array([y1 - y2, x2 - x1]) / math.hypot(x2 - x1, y2 - y1) * 0.1
    sides = [np.array([x1 + x2, y1 + y2]) / 2 + side * across for side in (1, -1)]
    if gates == [""]:
        assert [at(parts([*walls, *goal]), side) == at(parts([*walls, *goal]), start) for side in sides].count(
            True
        ) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_program_that_drives_blind_passes(tests: dict[str, ResolvedTest], name: str) -> None:
    passed = [what for what, program in PROGRAMS.items() if drive(tests[name], program).outcome == "passed"]
    assert (len(PROGRAMS), passed) == (21, [])


@pytest.mark.thorough
def test_a_schedule_that_was_made_for_a_drive_passes_it(tests: dict[str, ResolvedTest]) -> None:
    verdict = drive(tests["sil-closed-straight"], segments((0.6, 0.18, 0.095), (99.0, -0.0005, 0.095)))
    assert verdict.reason == "reached finish after 4.90 s"


@pytest.mark.proof
@pytest.mark.parametrize("name", NAMES)
def test_no_constant_passes_and_no_schedule_that_a_search_finds(tests: dict[str, ResolvedTest], name: str) -> None:
    """On tracks that are not straight, schedules of two and three segments are tried as well."""
    found = [(s / 400, p) for s in range(-116, 117) for p in (0.05, 0.12)]
    assert [each for each in found if drive(tests[name], constant(*each)).outcome == "passed"] == []
    seeds = range(400) if name in BENDS else ()
    assert [each for each in seeds if drive(tests[name], drawn(each, 2, 3)).outcome == "passed"] == []
