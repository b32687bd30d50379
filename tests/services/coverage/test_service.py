"""The share of an area that was passed over, against geometry."""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import shapely

from dodo_dsl.opendlv.assets.track import VehiclePose
from services.base import UnjudgeableError, Verdict
from services.coverage.model import CoverageGrid, Footprint
from tests.services.built import built, hand, refusal

FRAME, S = "opendlv.sim.Frame", 1_000_000
BEGIN = 1_700_000_000 * S
RECTANGLE = ("--x-min=0", "--x-max=4", "--y-min=0", "--y-max=2")
LOOP = [[0, 0, 2, 0], [2, 0, 2, 2], [2, 2, 0, 2], [0, 2, 0, 0]]


@contextmanager
def judge(*flags: str) -> Iterator[Any]:
    with built("coverage", *flags) as it:
        it.begin(BEGIN)
        yield it


def frame(it: Any, seconds: float, x: float, y: float, heading: float = 0.0) -> None:
    half = heading / 2
    hand(it, FRAME, BEGIN + round(seconds * S), 0, x=x, y=y, qz=math.sin(half), qw=math.cos(half))


def decided(it: Any, seconds: float) -> Verdict:
    it.end_of_input(BEGIN + round(seconds * S))
    assert it.verdict is not None
    return it.verdict


@pytest.mark.parametrize("shape", [("--length=0.2", "--width=0.5"), ("--diameter=0.5",)])
def test_strips_of_a_rectangle_are_passed_over(shape: tuple[str, ...]) -> None:
    """Three of four strips, from beyond one side to beyond the other, in moves of a metre."""
    with judge(*RECTANGLE, *shape, "--min-share=0.76") as it:
        for strip in range(3):
            for step in range(7):
                frame(it, strip * 7 + step, step - 1, 0.25 + strip * 0.5)
        verdict = decided(it, 30)
    covered, time, _ = verdict.checks
    assert covered.value == pytest.approx(0.75, abs=0.01) and (covered.ok, time.value, time.ok) == (False, None, False)
    assert (
        verdict.reason.startswith("passed over 7")
        and ", expected at least 76 %; the vehicle is at x = 5.00 m" in verdict.reason
    )


def test_it_passes_as_soon_as_the_share_is_reached() -> None:
    with judge(*RECTANGLE, "--length=0.12", "--width=2", "--min-share=0.5", "--max-time=10") as it:
        frame(it, -1, 3.0, 1)
        for step in range(5):
            frame(it, step, step - 1 + 0.5, 1)
        assert it.verdict is not None and it.verdict.outcome == "passed"
        assert it.verdict.reason == "passed over 64 % of the rectangle after 3.00 s"
        assert [check.ok for check in it.verdict.checks] == [True] * 3
        assert it.verdict.checks[1].value == 3.0


def test_a_way_against_shapely() -> None:
    """A disc along a curve, in an area with a bay: the share that a buffered line covers."""
    area = shapely.Polygon([(0, 0), (5, 0), (5, 3), (3, 3), (2.5, 1.5), (2, 3), (0, 3)])
    grid = CoverageGrid(area, 0.02, Footprint(0.6, 0.0))
    poses = [VehiclePose(t, 1.5 + math.sin(2 * t), 0.0) for t in (step / 50 for step in range(300))]
    for start, end in pairwise(poses):
        grid.move(start, end)
    swept = shapely.LineString([(pose.x, pose.y) for pose in poses]).buffer(0.3, quad_segs=64)
    assert grid.share == pytest.approx(shapely.intersection(area, swept).area / area.area, abs=0.003)


def test_the_area_is_a_loop_of_the_map(tmp_path: Path) -> None:
    """Whatever the order and direction of its lines; a loop within is part of it."""
    inner = [[0.5, 0.5, 1, 0.5], [1, 0.5, 1, 1], [1, 1, 0.5, 0.5]]
    lawn = {"name": "lawn", "lines": [LOOP[2], LOOP[0], [2, 2, 2, 0], *inner, LOOP[3]]}
    open_ = {"name": "open", "lines": LOOP[:3]}
    (tmp_path / "map.json").write_text(json.dumps({"obstacles": [lawn, open_]}))
    with judge(f"--map-path={tmp_path}", "--area=lawn", "--length=4", "--width=1") as it:
        frame(it, 0, 1, 0.5)
        assert decided(it, 1).checks[0].value == 0.5
    said = f"the lines of obstacle 'open' of the map {tmp_path} enclose nothing: they must end where they begin"
    assert refusal("coverage", f"--map-path={tmp_path}", "--area=open") == said
    said = f"the map {tmp_path} has no obstacle 'x'; it has lawn, open"
    assert refusal("coverage", f"--map-path={tmp_path}", "--area=x") == said


def test_without_a_frame_there_is_no_verdict_and_a_vehicle_that_stands_fails() -> None:
    with judge(*RECTANGLE) as it, pytest.raises(UnjudgeableError, match=r"^no opendlv.sim.Frame of the vehicle came"):
        decided(it, 5)
    with judge(*RECTANGLE) as it:
        for step in range(5):
            frame(it, step, 1, 1)
        frame(it, 3, 3, 1)
        hand(it, FRAME, BEGIN + 6 * S, 0, x=3.0, y=1.0)
        assert decided(it, 7).checks[0].value == pytest.approx(0.36 * 0.16 / 8, rel=0.01)


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (
            ("--area=a", *RECTANGLE),
            "give the area either as a loop of the map, --area, or as a rectangle, --x-min and so",
        ),
        (("--area=a",), "--area=a needs --map-path, the map that has it"),
        (RECTANGLE[:3], "--y-max of the rectangle is missing"),
        (("--x-min=5", *RECTANGLE[1:]), "--x-min=5 is not less than --x-max=4"),
        ((*RECTANGLE, "--cell=0.001"), "--cell=0.001 makes 8,000,000 cells, expected 0.0014 m or more"),
    ],
)
def test_flags_that_make_no_area_are_refused(flags: tuple[str, ...], said: str) -> None:
    assert refusal("coverage", *flags).startswith(said)
