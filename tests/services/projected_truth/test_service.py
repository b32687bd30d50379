"""True boxes of pictures that another camera takes."""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base import Context, Output
from services.base.clock import RealTimeClock
from services.base.flags import load_manifest, parse
from services.projected_truth.service import PATIENCE, ProjectedTruth, build
from services.virtual_camera import service as virtual_camera
from tests.services.map_folders import write_map
from tests.services.process import ROOT

__all__ = ["write_map"]

MESSAGES = MessageSet.standard()
SERVICES = package_data.services()
MAP = f"--map-path={ROOT / 'tests_registry' / 'maps' / 'rig-straight'}"
SIZE = ("--width=320", "--height=240", "--z=0.095")
BEGIN, PICTURE = 1_700_000_000_000_000, 100_000
LENS = ("--distortion.k1=-0.1", "--fovy=55", "--pitch=-4")
SENSOR = ("--focal-x=240", "--centre-x=170", "--centre-y=112.5")


class Projection:
    """The service beside a memory that a camera would write."""

    def __init__(self, resources: ExitStack, *flags: str, where: str = MAP) -> None:
        name = f"dodo-test-{os.getpid()}.followed"
        self.memory = resources.enter_context(SharedMemory.create(name, 320 * 240 * 3 // 2))
        words = ["--cid=111", where, *SIZE, f"--follow={name}", "--truth-sender=9", *flags]
        parsed = parse(load_manifest(SERVICES / "projected_truth"), words)
        self.service = build(Context("projected-truth", parsed, MESSAGES, resources))
        self.picture(BEGIN - PICTURE)
        assert self.update(BEGIN - PICTURE) == [], "what is there at first may not be a picture"
        self.service.begin(BEGIN)

    def picture(self, time: int) -> None:
        with self.memory.lock():
            self.memory.stamp(time)

    def frame(self, time: int, x: float, y: float = 0.0, yaw: float = 0.0, stamp: int = 4) -> None:
        frame = MESSAGES.type("opendlv.sim.Frame")(x=x, y=y, qz=math.sin(yaw / 2), qw=math.cos(yaw / 2))
        self.service.inputs["opendlv.sim.Frame", stamp](frame, time)

    def update(self, now: int) -> list[Output]:
        return list(self.service.update(now))  # type: ignore[arg-type]


@pytest.fixture
def resources() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def drawn(resources: ExitStack, x: float, y: float, yaw: float, *flags: str) -> list[tuple[Any, int]]:
    """What the virtual camera says of its own picture from a place."""
    names = [f"--name.{kind}=dodo-test-{os.getpid()}.{kind}" for kind in ("argb", "i420")]
    start = [f"--start-x={x}", f"--start-y={y}", f"--start-yaw={math.degrees(yaw)}"]
    words = ["--cid=111", MAP, *SIZE, *names, *start, "--truth-sender=9", *flags]
    parsed = parse(load_manifest(SERVICES / "virtual_camera"), words)
    camera = virtual_camera.build(Context("virtual-camera", parsed, MESSAGES, resources))
    return [(each.message, each.sender_stamp) for each in camera.update(BEGIN)]  # type: ignore[union-attr]


@pytest.mark.parametrize("flags", [(), LENS, SENSOR, (*LENS, *SENSOR)])
@pytest.mark.thorough
def test_it_says_what_a_virtual_camera_at_the_same_place_says(resources: ExitStack, flags: tuple[str, ...]) -> None:
    """The pose at the picture's time lies between two measured ones; the boxes have the picture's sample time."""
    projection = Projection(resources, "--frame-id=4", "--latency=0.01", *flags)
    projection.picture(BEGIN + 30_000)
    projection.frame(BEGIN, -0.8, 0.02, -0.1)
    assert projection.update(BEGIN + 35_000) == [], "it waits for the pose behind the picture"
    projection.frame(BEGIN + 40_000, -0.6, 0.06, -0.1)
    found = projection.update(BEGIN + 45_000)
    expected = drawn(resources, -0.7, 0.04, -0.1, *flags)
    assert len(expected) >= 3 * 8 and {each.sample_time for each in found} == {BEGIN + 30_000}
    assert [each.sender_stamp for each in found] == [stamp for _, stamp in expected]
    for each, (message, _) in zip(found, expected, strict=True):
        assert type(each.message) is type(message)
        for field, value in message.ListFields():
            assert getattr(each.message, field.name) == (pytest.approx(value, abs=1e-6)), field.name
    assert projection.update(BEGIN + 50_000) == [], "each picture has its boxes once"


def test_a_pose_that_does_not_come_is_waited_for_and_then_extrapolated(resources: ExitStack) -> None:
    projection = Projection(resources, "--frame-id=4")
    projection.frame(BEGIN, -0.8)
    projection.picture(BEGIN + 10_000)
    assert projection.update(BEGIN + 10_000 + PATIENCE) == []
    assert projection.update(BEGIN + 10_001 + PATIENCE)


def test_pictures_without_a_pose_are_counted(resources: ExitStack, caplog: pytest.LogCaptureFixture) -> None:
    projection = Projection(resources, "--frame-id=4")
    projection.picture(BEGIN)
    assert projection.update(BEGIN + PATIENCE + 1) == []
    assert isinstance(projection.service, ProjectedTruth)
    assert (projection.service.projected, projection.service.missed) == (0, 1)
    resources.close()
    assert "1 pictures have no truth: no pose was measured near them" in caplog.text


def test_other_bodies_are_where_they_were_at_the_picture(resources: ExitStack, write_map: Callable[..., Path]) -> None:
    """Each is waited for once it has begun to send."""
    car = {"name": "car", "file": "cube.obj", "color": [1, 0, 0], "frames": [2, 4, 5]}
    projection = Projection(resources, "--frame-id=4", where=f"--map-path={write_map({'model': [car]})}")
    boxes = []
    for turn in range(2):
        begin = BEGIN + turn * 100_000
        for time, y in ((begin, 0.0), (begin + 40_000, 1.0)):
            projection.frame(time, 0.0)
            if time == begin:
                projection.frame(time, 4.0, y, stamp=5)
        projection.picture(begin + 10_000 + 10_000 * turn)
        assert projection.update(begin + 45_000) == []
        projection.frame(begin + 40_000, 4.0, 1.0, stamp=5)
        boxes.append([each.message for each in projection.update(begin + 46_000)])
    assert [message.property for message, *_ in (each[1:] for each in boxes)] == ["car", "car"]
    assert boxes[0][2].x - boxes[1][2].x == pytest.approx(boxes[0][2].width / 4, rel=0.2), "0.25 m to the left"


class SteppedClock(RealTimeClock):
    """Of lockstep, as far as a service is built with it."""

    relays = True


def test_lockstep_is_refused() -> None:
    flags = parse(load_manifest(SERVICES / "projected_truth"), ["--cid=111", MAP, "--truth-sender=9"])
    context = Context("projected-truth", flags, MESSAGES, clock=SteppedClock())
    with pytest.raises(ValueError, match="in lockstep virtual-camera has a truth-sender"):
        build(context)
