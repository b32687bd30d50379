"""A camera's memory recorded and played again: the same pictures, bit for bit or nearly."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.memory import pixels
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import read_envelopes
from dodo_dsl.opendlv.video.decoder import VideoDecoder
from tests.services.process import PATIENCE, running, send
from tests.services.rec_replay.viewer import Viewer

WIDTH, HEIGHT, COUNT = 160, 120, 8
T0, PERIOD = 1_700_000_000_000_000, 50_000
IMAGE = 1055


def scene(number: int, kind: str) -> pixels.Picture:
    """A floor with a box that moves; every picture is another."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.dstack([x + y, 2 * y, 255 - x]).astype(np.uint8)
    picture[40:60, 10 * number : 10 * number + 20] = (0, 220, 250)
    return pixels.from_bgr(picture, kind)


class CameraMemory:
    """A camera that shows a picture whenever it is told to."""

    def __init__(self, kind: str) -> None:
        self.kind, self.name = kind, f"recorded-{os.getpid()}.{kind}"
        self.memory = SharedMemory.create(self.name, pixels.size(kind, WIDTH, HEIGHT))

    def show(self, number: int) -> None:
        with self.memory.lock():
            self.memory.buffer[:] = scene(number, self.kind).tobytes()
            self.memory.stamp(T0 + number * PERIOD)
            self.memory.notify_all()


def recorded(path: Path) -> list[int]:
    """Numbers of the pictures in a recording."""
    return [(e.sample_time - T0) // PERIOD for e in read_envelopes(path) if e.data_type == IMAGE]


def wait_for(path: Path, numbers: list[int]) -> None:
    deadline = time.monotonic() + PATIENCE
    while recorded(path) != numbers:
        assert time.monotonic() < deadline, f"{recorded(path)} were recorded"
        time.sleep(0.002)


def record(cid: int, folder: Path, kind: str, *flags: str) -> Path:
    path, camera = folder / "drive.rec", CameraMemory(kind)
    memories = f"--memories={camera.name}:{WIDTH}x{HEIGHT}"
    with (
        camera.memory,
        Session(cid) as session,
        running("rec_recorder", folder, f"--cid={cid}", f"--rec={path}", "--frames=20", memories, *flags),
    ):
        time.sleep(0.3)  # until the recorder has found the memory
        for number in range(COUNT):
            send(session, "opendlv.proxy.PedalPositionRequest", sample_time=T0 + number * PERIOD + 1, position=number)
            camera.show(number)
            wait_for(path, list(range(number + 1)))
    return path


@pytest.mark.parametrize("kind", ["i420", "argb"])
def test_lossless_pictures_come_back_bit_for_bit(cid: int, tmp_path: Path, kind: str) -> None:
    path = record(cid, tmp_path, kind, "--lossless")
    assert sum(e.data_type == 1086 for e in read_envelopes(path)) == COUNT
    name = f"played-{os.getpid()}"
    names = [f"--name.{each}={name}.{each}" for each in ("argb", "i420")]
    with (
        Session(cid) as session,
        running("rec_replay", tmp_path, f"--cid={cid}", f"--rec={path}", *names),
        Viewer(f"{name}.{kind}") as viewer,
    ):
        time.sleep(0.1)
        send(session, "dodo.TestBegin")
        viewer.wait_for(COUNT)
    assert viewer.seen == [(scene(n, kind).tobytes(), T0 + n * PERIOD) for n in range(COUNT)]


def test_messages_are_as_opendlv_has_them(cid: int, tmp_path: Path) -> None:
    path = record(cid, tmp_path, "i420", "--key-interval=3", "--quality=20", "--id=5")
    decoder, messages = VideoDecoder("h264"), MessageSet.standard()
    envelopes = [e for e in read_envelopes(path) if e.data_type == IMAGE]
    for number, envelope in enumerate(envelopes):
        image = messages.decode(IMAGE, envelope.payload)
        assert (image.format, image.width, image.height, image.sampleId) == ("h264", WIDTH, HEIGHT, number)
        assert (b"\0\0\0\1\x67" in image.data) == (number % 3 == 0)
        assert (envelope.sender_stamp, envelope.sample_time) == (5, T0 + number * PERIOD)
        assert 0 < envelope.sent == envelope.received
        frame = decoder.decode(image.data)
        assert frame is not None
        error = frame.pixels("i420").astype(float) - scene(number, "i420")
        assert 10 * np.log10(255**2 / (error**2).mean()) > 36  # PSNR in dB
    assert len(envelopes) == COUNT


def test_commands_pause_pictures_and_messages(cid: int, tmp_path: Path) -> None:
    path, camera = tmp_path / "drive.rec", CameraMemory("i420")
    flags = (f"--cid={cid}", f"--rec={path}", "--frames=20", f"--memories={camera.name}:{WIDTH}x{HEIGHT}", "--paused")
    with camera.memory, Session(cid) as session, running("rec_recorder", tmp_path, *flags):
        send(session, "opendlv.proxy.PedalPositionRequest")
        send(session, "cluon.data.RecorderCommand", command=1)
        time.sleep(0.3)
        camera.show(0)
        wait_for(path, [0])
        send(session, "cluon.data.RecorderCommand", command=2)
        time.sleep(0.1)
        camera.show(1)
        time.sleep(0.1)
        send(session, "cluon.data.RecorderCommand", command=1)
        time.sleep(0.1)
        camera.show(2)
        wait_for(path, [0, 2])
    envelopes = list(read_envelopes(path))
    assert [e.data_type for e in envelopes] == [IMAGE, 11, IMAGE]
    image = MessageSet.standard().decode(IMAGE, envelopes[2].payload)
    assert b"\0\0\0\1\x67" in image.data  # it can be decoded without the picture that is missing
