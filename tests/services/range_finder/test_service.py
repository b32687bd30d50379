"""The range finder's flags, from its command line to its messages."""

import math
from pathlib import Path
from typing import Any

import pytest

from tests.services.built import built, hand, refusal

FRAME, VOLTAGE = "opendlv.sim.Frame", "opendlv.proxy.VoltageReading"
WALL = {"obstacles": [{"name": "wall", "lines": [[2, -9, 2, 9]]}]}
CAR = {"name": "car", "file": "cube.obj", "color": [1, 0, 0], "frames": [0, 1]}
NORTH = {"qz": math.sin(math.pi / 4), "qw": math.cos(math.pi / 4)}


@pytest.fixture
def folder(write_map: Any) -> Path:
    return Path(write_map({**WALL, "model": [CAR]}))


def read(service: Any) -> dict[int, float]:
    return {o.sender_stamp: next(v for _, v in o.message.ListFields()) if o.message.ListFields() else 0.0
            for o in service.update(0)}  # fmt: skip


def test_each_sensor_sends_under_its_stamp(folder: Path) -> None:
    flags = ["--id=6,7,8", "--x=0.2,-0.2,0", "--yaw=0,180,90", "--rays=1", "--freq=5", "--walls=wall", "--frame-id=0"]
    with built("range_finder", f"--map-path={folder}", *flags) as service:
        assert service.period == 200_000
        assert read(service) == {}, "before the first frame of the vehicle"
        hand(service, FRAME, 0, 0, qw=1.0)
        assert read(service) == pytest.approx({6: 1.8, 7: 6.0, 8: 6.0})
        hand(service, FRAME, 0, 0, x=1.0, **NORTH)
        assert read(service) == pytest.approx({6: 6.0, 7: 6.0, 8: 6.0}), "it looks along the wall"
        assert {str(o.message.DESCRIPTOR.full_name).rsplit(".", 1)[-1] for o in service.update(0)} == {
            "DistanceReading"
        }


def test_infrared_sensors_send_volts(folder: Path) -> None:
    flags = ["--id=1", f"--message={VOLTAGE}", "--walls=wall"]
    with built("range_finder", f"--map-path={folder}", *flags) as service:
        hand(service, FRAME, 0, 0, x=2 - 0.22, qw=1.0)
        assert read(service) == pytest.approx({1: 0.6})
    with built("range_finder", f"--map-path={folder}", "--id=1", "--sensor=infrared", "--walls=wall") as service:
        hand(service, FRAME, 0, 0, x=2 - 0.22, qw=1.0)
        assert read(service) == pytest.approx({1: 0.22})


def test_another_car_is_seen_and_the_own_is_not(folder: Path) -> None:
    with built("range_finder", f"--map-path={folder}", "--id=0", "--rays=1") as service:
        hand(service, FRAME, 0, 0, qw=1.0)
        assert read(service) == {0: 6.0}
        hand(service, FRAME, 0, 1, x=3.0, qw=1.0)
        assert read(service) == pytest.approx({0: 2.5})


def test_silence_and_frames_that_are_none(folder: Path) -> None:
    with built("range_finder", f"--map-path={folder}", "--id=0", "--beyond=silence") as service:
        hand(service, FRAME, 0, 0, x=math.nan, qw=1.0)
        hand(service, FRAME, 0, 0)
        assert service.places.vehicle is None
        hand(service, FRAME, 0, 0, qw=1.0)
        assert read(service) == {}


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--id=0,0"], "--id needs a different sender stamp for each sensor"),
        (["--id=0,1,2", "--yaw=0,90"], "--yaw has 2 items, expected one, or 3 as --id has"),
        (["--id=0", "--sensor=ultrasonic", f"--message={VOLTAGE}"], f"--message={VOLTAGE} is of infrared sensors"),
        (["--id=0", "--min-range=2", "--max-range=2"], "the range from 2 to 2 m is empty"),
        (["--id=0", "--walls=wal"], "there is no obstacle 'wal'"),
        (["--id=0", "--sensor=infrared", "--curve=1,2"], "--curve=1,2 needs two points"),
    ],
)
def test_flags_that_do_not_fit_are_refused(folder: Path, flags: list[str], said: str) -> None:
    assert said in refusal("range_finder", f"--map-path={folder}", *flags)
