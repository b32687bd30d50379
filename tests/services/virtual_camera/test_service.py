"""Each flag of the service, from its command line to what lies in memory and what is sent."""

import math
import os
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base import Context, Output
from services.base.flags import load_manifest, parse
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.virtual_camera.service import build
from tests.services.built import hand

MANIFEST = load_manifest(package_data.services() / "virtual_camera")
STRAIGHT = package_data.registry() / "maps" / "straight"
MESSAGES = MessageSet.standard()
PLACE = ["--z=0.095", "--yaw=90"]
START, STEP = 1_700_000_000_000_000, 50_000
NUMBERS = count()

# what is written with and without the flag, both times beside PLACE
PICTURED = {
    "fovy": ([], "60"),
    "x": ([], "0.05"),
    "y": ([], "0.05"),
    "z": ([], "0.12"),
    "roll": ([], "5"),
    "pitch": ([], "5"),
    "yaw": ([], "100"),
    "start-x": (["--start-y=0.3"], "0.05"),
    "start-y": (["--start-x=0.05"], "0.3"),
    "start-yaw": (["--start-x=0"], "10"),
    "light.azimuth": (["--light.ambient=0.3"], "20"),
    "light.elevation": (["--light.ambient=0.3"], "20"),
    "light.ambient": ([], "0.2"),
    "lines": ([], "left,finish"),
    "line-width": (["--lines=left"], "0.05"),
    "clutter": ([], "60"),
    "displaced": ([], "0.05"),
    "exposure": ([], "0.4"),
    "gain": ([], "2"),
    "noise": ([], "0.02"),
    "shutter": ([], "0.05"),
    "distortion.k1": ([], "-0.2"),
    "distortion.k2": ([], "0.1"),
    "distortion.p1": ([], "0.02"),
    "focal-x": ([], "150"),
    "centre-x": ([], "84"),
    "centre-y": ([], "55"),
    "distortion.p2": ([], "0.02"),
    "seed": (["--noise=0.02"], "3"),
}
OTHERS = {"map-path", "width", "height", "freq", "frame-id", "name.argb", "name.i420", "name.bgr", "name.rgb"}
TRUTH = {"truth-sender", "truth-classes", "truth-min-visible", "truth-min-height"}


class Shot(NamedTuple):
    """One picture in all its forms, and what was sent with it."""

    argb: Any
    i420: Any
    bgr: Any
    rgb: Any
    sample_time: int
    outputs: list[Output]


class Camera:
    """The service on memories of its own; frames are (x, y, yaw) 50 ms apart."""

    def __init__(self, *flags: str, size: tuple[int, int] = (160, 120), map_path: Path = STRAIGHT) -> None:
        written = {word.partition("=")[0]: word for word in (*PLACE, *flags)}
        names = {kind: f"dodo-test-{os.getpid()}-{next(NUMBERS)}.{kind}" for kind in ("argb", "i420", "bgr", "rgb")}
        own = [f"--cid=111 --map-path={map_path} --width={size[0]} --height={size[1]}".split()]
        own.append([f"--name.{kind}={name}" for kind, name in names.items()])
        self.resources = ExitStack()
        self._size = size
        parsed = parse(MANIFEST, [*own[0], *own[1], *written.values()])
        self.service = build(Context("virtual-camera", parsed, MESSAGES, self.resources))
        self._memories = [self.resources.enter_context(SharedMemory.attach(name)) for name in names.values()]

    def shoot(self, *frames: tuple[float, float, float], now: int = START, frame_id: int = 0) -> Shot:
        take = self.service.inputs["opendlv.sim.Frame", frame_id]
        for number, (x, y, yaw) in enumerate(frames, 1 - len(frames)):
            fields = {"x": x, "y": y, "qz": math.sin(yaw / 2), "qw": math.cos(yaw / 2)}
            take(MESSAGES.type("opendlv.sim.Frame")(**fields), now + number * STEP)
        outputs = list(self.service.update(now))
        (wide, high), shot = self._size, []
        for memory, shape in zip(
            self._memories, [(high, wide, 4), (high * 3 // 2, wide), (high, wide, 3), (high, wide, 3)], strict=True
        ):
            with memory.lock():
                raw = bytes(memory.buffer[: math.prod(shape)])
                shot.append(np.frombuffer(raw, np.uint8).reshape(shape))
                sample_time = memory.sample_time()
        return Shot(*shot, sample_time, outputs)


@pytest.fixture
def camera():
    with ExitStack() as stack:

        def make(*flags: str, **more: Any) -> Camera:
            made = Camera(*flags, **more)
            stack.enter_context(made.resources)
            return made

        yield make


def test_each_parameter_is_tested_here():
    assert {*PICTURED, *OTHERS, *TRUTH} == set(MANIFEST["parameters"])


@pytest.mark.thorough
@pytest.mark.parametrize("name", PICTURED)
def test_each_parameter_changes_the_picture(camera, name):
    beside, value = PICTURED[name]
    frames = () if name.startswith("start-") else ((0.0, 0.0, 0.0), (0.0, 0.02, 0.05))
    without, given = (camera(*beside, *more).shoot(*frames) for more in ([], [f"--{name}={value}"]))
    assert (without.argb != given.argb).any(axis=-1).sum() > 20
    assert (given.argb[..., 3] == 255).all()


def test_without_flags_the_picture_is_the_plain_one(camera):
    shot = camera().shoot((0.0, 0.1, 0.0), (0.0, 0.12, 0.05))
    plain = Renderer(load_scene(STRAIGHT), 160, 120, math.radians(48.8))
    assert np.array_equal(shot.argb, plain.render(CameraPose.at(0, 0.12, 0.095, yaw=math.pi / 2 + 0.05)))
    assert shot.outputs == []


def test_all_memories_hold_the_same_picture_and_time(camera):
    shot = camera(size=(64, 50)).shoot((0.0, 0.2, 0.0), now=START + 7)
    assert shot.argb.std() > 10
    assert np.array_equal(shot.bgr, shot.argb[..., :3])
    assert np.array_equal(shot.rgb, shot.argb[..., 2::-1])
    assert np.array_equal(shot.i420, cv2.cvtColor(shot.argb, cv2.COLOR_BGRA2YUV_I420))
    assert shot.sample_time == START + 7


def test_models_at_frames_move_with_them_but_for_the_own_one(camera, write_map):
    """A frame that is no place leaves them where they are."""
    folder = write_map({"model": [{"name": "car", "file": "cube.obj", "color": [1, 0, 0], "frames": [4, 0, 5]}]})
    made = camera("--frame-id=4", "--truth-sender=9", map_path=folder)
    assert set(made.service.inputs) == {("opendlv.sim.Frame", stamp) for stamp in (0, 4, 5)}
    alone = made.shoot((0.0, 0.0, 0.0), frame_id=4)
    assert alone.outputs == []
    frame = MESSAGES.type("opendlv.sim.Frame")
    made.service.inputs["opendlv.sim.Frame", 5](frame(y=3.0, qw=1.0), START)
    shots = [made.shoot((0.0, 0.0, 0.0), frame_id=4)]
    hand(made.service, "opendlv.sim.Frame", START, 5, y=9.0)
    shots += [made.shoot((0.0, 0.0, 0.0), frame_id=4), made.shoot((0.0, 1.0, 0.0), frame_id=4)]
    assert np.array_equal(shots[0].argb, shots[1].argb)
    assert not np.array_equal(shots[0].argb, alone.argb)
    properties = [[o.message.property for o in shot.outputs if hasattr(o.message, "property")] for shot in shots]
    widths = [o.message.width for shot in shots for o in shot.outputs if hasattr(o.message, "width")]
    assert properties == [["car"]] * 3
    assert widths[0] == widths[1] < widths[2]


def told(outputs: list[Output]) -> dict[int, dict[str, Any]]:
    """What was said of each detection, by the message's name."""
    found: dict[int, dict[str, Any]] = {}
    for message, *_ in outputs:
        found.setdefault(message.detectionId, {})[message.DESCRIPTOR.name] = message
    return found


def test_true_boxes_follow_as_three_messages_each(camera):
    classes = "--truth-classes=cone_blue=blue,cone_yellow=yellow"
    shot = camera("--truth-sender=9", classes, size=(640, 480)).shoot((0.0, 0.0, 0.0))
    assert {output.sender_stamp for output in shot.outputs} == {9}
    found = told(shot.outputs)
    assert len(shot.outputs) == 3 * len(found)
    sides = {"blue": [], "yellow": []}
    for said in found.values():
        box, name = said["DetectionBoundingBox"], said["DetectionProperty"].property
        assert said["DetectionType"].type == {"blue": 1, "yellow": 2}[name]
        assert 0 <= box.x <= box.x + box.width <= 1 + 1e-6
        assert 0 <= box.y <= box.y + box.height <= 1 + 1e-6
        sides[name].append(box.x + box.width / 2)
        seen = shot.bgr[round(480 * (box.y + box.height / 2)), round(640 * (box.x + box.width / 2))]
        assert int(np.argmax(seen)) == {"blue": 0, "yellow": 2}[name] or box.height * 480 < 10
    assert max(sides["yellow"]) < 0.5 < min(sides["blue"])
    assert min(map(len, sides.values())) > 3


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        ("--truth-classes=cone_green", "no model 'cone_green' in the map, which has cone_yellow, cone_blue, cone_red"),
        ("--lines=middle", "no obstacle 'middle' with lines; the map has behind, beyond, finish, left, right"),
        ("--distortion.k1=-1.5", "its distortion folds the picture"),
        ("--map-path=/nowhere", "/nowhere: cannot be read: No such file"),
    ],
)
def test_what_cannot_be_is_told(camera, flag, message):
    with pytest.raises(ValueError, match=message):
        camera("--truth-sender=9", flag)
