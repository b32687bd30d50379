"""A camera's memory recorded and played again: the same pictures, bit for bit or nearly."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.shared_memory import SharedMemory
from dodo_dsl.opendlv.video import VideoDecoder, VideoEncoder
from services.rec_recorder import service
from services.rec_recorder.service import Recorder
from services.rec_recorder.source import SourceError
from tests.services.built import MESSAGES, built

WIDTH, HEIGHT, COUNT = 160, 120, 8
T0, PERIOD = 1_700_000_000_000_000, 50_000
IMAGE = 1055


def scene(number: int, kind: str) -> pixels.Picture:
    """A floor with a box that moves; every picture is another."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.dstack([x + y, 2 * y, 255 - x]).astype(np.uint8)
    picture[40:60, 10 * number : 10 * number + 20] = (0, 220, 250)
    return pixels.converted(picture, "bgr", kind)


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


class Stage:
    """The recorder in this process, beside a camera."""

    def __init__(self, recorder: Recorder, camera: CameraMemory) -> None:
        self.recorder, self.camera = recorder, camera
        self.update()

    def update(self) -> None:
        self.recorder.update(time.time_ns() // 1000)

    def show(self, number: int) -> None:
        self.camera.show(number)
        self.update()

    def hear(self, name: str, sample_time: int = 0, **fields: Any) -> None:
        message = MESSAGES.type(name)(**fields)
        envelope = Envelope(MESSAGES.id(name), MESSAGES.encode(message), 1, 1, sample_time, 0)
        self.recorder.observe(envelope)


@contextmanager
def staged(path: Path, kind: str, *flags: str, width: int = WIDTH) -> Iterator[Stage]:
    camera = CameraMemory(kind)
    memories = f"--memories={camera.name}:{width}x{HEIGHT}"
    with camera.memory, built("rec_recorder", f"--rec={path}", "--frames=20", memories, *flags) as recorder:
        yield Stage(recorder, camera)


def test_pictures_alone_are_in_a_recording_of_their_own(tmp_path: Path) -> None:
    path, pictures = tmp_path / "drive.rec", tmp_path / "frames.rec"
    with staged(path, "i420", f"--pictures={pictures}") as stage:
        for number in range(COUNT):
            stage.hear("opendlv.proxy.PedalPositionRequest")
            stage.show(number)
    assert recorded(pictures) == list(range(COUNT))
    assert {e.data_type for e in read_envelopes(path)} == {1086}
    decoder = VideoDecoder("h264")
    frames = [decoder.decode(MESSAGES.decode(IMAGE, e.payload).data) for e in read_envelopes(pictures)]
    error = frames[-1].pixels("i420").astype(float) - scene(COUNT - 1, "i420")  # type: ignore[union-attr]
    assert 10 * np.log10(255**2 / (error**2).mean()) > 34  # PSNR in dB


def test_pictures_of_a_test_that_has_passed_are_not_encoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its runner removes their file; of a long test the oldest were encoded before."""
    encoded: list[int] = []
    encode = VideoEncoder.encode

    def counted(self: VideoEncoder, picture: pixels.Picture) -> bytes:
        encoded.append(len(encoded))
        return encode(self, picture)

    monkeypatch.setattr(VideoEncoder, "encode", counted)
    monkeypatch.setattr(service, "WAITING", 3 * pixels.size("i420", WIDTH, HEIGHT))
    pictures = tmp_path / "frames.rec"
    with staged(tmp_path / "drive.rec", "argb", f"--pictures={pictures}") as stage:
        for number in range(COUNT):
            stage.show(number)
        assert len(encoded) == COUNT - 3
        assert recorded(pictures) == list(range(COUNT - 3))
        pictures.unlink()
    assert len(encoded) == COUNT - 3
    assert not pictures.exists()


def test_pictures_of_odd_size_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Of 161 x 120 pixels, which h264 cannot have."""
    size = f"--memories=odd-{os.getpid()}.argb:161x120"
    with SharedMemory.create(f"odd-{os.getpid()}.argb", 161 * 120 * 4) as memory:
        words = (f"--rec={tmp_path / 'drive.rec'}", f"--pictures={tmp_path / 'frames.rec'}", "--frames=20", size)
        with built("rec_recorder", *words) as recorder:
            recorder.update(1)
            with memory.lock():
                memory.stamp(T0)
            recorder.update(2)
    assert [r.getMessage() for r in caplog.records] == [
        "no pictures are recorded: i420 needs an even width and height, not 161 x 120"
    ]


def test_what_cannot_be_encoded_ends_only_the_pictures_that_decide_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with staged(tmp_path / "one.rec", "i420", f"--pictures={tmp_path / 'frames.rec'}", width=162) as stage:
        stage.show(0)
        stage.show(1)
    assert [r.getMessage() for r in caplog.records] == [
        f"no pictures are recorded: memory 'recorded-{os.getpid()}.i420' has 28800 bytes, "
        "not those of a picture of 162 x 120 pixels"
    ]
    with staged(tmp_path / "two.rec", "i420", width=162) as stage, pytest.raises(SourceError):
        stage.show(0)
