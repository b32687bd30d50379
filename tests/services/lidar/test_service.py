"""The lidar's flags, from its command line to its messages on the bus."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.services.built import built, hand, refusal

FRAME, SCAN = "opendlv.sim.Frame", "robot.PlanarScan"
WALL = {"obstacles": [{"name": "wall", "lines": [[2, -9, 2, 9]]}]}
CAR = {"name": "car", "file": "cube.obj", "color": [1, 0, 0], "frames": [0, 1]}


@pytest.fixture
def folder(write_map: Any) -> Path:
    return Path(write_map({**WALL, "model": [CAR]}))


def test_a_scan_says_how_it_is_to_be_read(folder: Path) -> None:
    def ranges() -> list[float]:
        return np.frombuffer(service.update(0)[0].message.ranges, "<f4").tolist()

    flags = ["--id=7", "--freq=40", "--field-of-view=180", "--rays=3", "--x=0.5", "--walls=wall", "--max-range=5"]
    with built("lidar", f"--map-path={folder}", *flags) as service:
        assert (service.period, service.update(0)) == (25_000, []), "before the first frame of the vehicle"
        hand(service, FRAME, 0, 0, qw=1.0)
        (output,) = service.update(0)
        assert (output.message.DESCRIPTOR.full_name, output.sender_stamp) == (SCAN, 7)
        facts = [getattr(output.message, n) for n in ("angleMin", "angleIncrement", "rangeMin", "rangeMax")]
        assert facts == pytest.approx([-math.pi / 2, math.pi / 2, 0.15, 5.0])
        assert ranges() == [math.inf, 1.5, math.inf]
        hand(service, FRAME, 0, 1, x=1.5, qw=1.0)
        hand(service, FRAME, 0, 0, x=math.nan, qw=1.0)
        assert ranges() == [math.inf, 0.5, math.inf], "another car, and not the own one"


def test_an_empty_range_is_refused(folder: Path) -> None:
    said = refusal("lidar", f"--map-path={folder}", "--min-range=2", "--max-range=2")
    assert said == "the range from 2 to 2 m is empty: --min-range has to be below --max-range"
