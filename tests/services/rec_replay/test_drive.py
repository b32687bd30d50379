"""A simulated drive, recorded on the bus and replayed."""

import importlib.util
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
from tests.services.process import PATIENCE, running, send
from tests.services.rec_replay.viewer import Viewer

MAKER = Path(__file__).parents[3] / "tests_registry" / "recordings" / "make_recordings.py"
SECONDS = 1.5
PICTURES = 16
IMAGE, STATUS, BEGIN, END = 1055, 10, 2900, 2901
LEAST_PSNR = 40.0  # dB; 42.7 and more was measured at the default quality (I420, all three planes)
Key = tuple[int, bytes, int, int]
Shown = list[tuple[bytes, int]]


def key(envelope: Envelope) -> Key:
    return envelope.data_type, envelope.payload, envelope.sample_time, envelope.sender_stamp


def program() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_recordings", MAKER)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class OnTheBus:
    """Takes a simulated drive as a recording does: its messages go to the bus and its pictures into shared memory.

    Each waits until `path` has it, so that the drive is as fast as its recorder.
    """

    def __init__(self, session: Session, memory: SharedMemory, path: Path) -> None:
        self.messages = MessageSet.standard()
        self.said: list[Key] = []
        self.shown: Shown = []
        self._session, self._memory, self._path = session, memory, path

    def say(self, now: int, name: str, sender_stamp: int = 0, **fields: Any) -> None:
        payload = self.messages.encode(self.messages.type(name)(**fields))
        envelope = Envelope(self.messages.id(name), payload, now, now, now, sender_stamp)
        self._session.send_envelope(envelope)
        self.said.append(key(envelope))

    def show(self, i420: Any, now: int) -> None:
        self.publish(i420.tobytes(), now)
        self.shown.append((i420.tobytes(), now))
        self.until_recorded(lambda envelope: envelope.data_type == IMAGE and envelope.sample_time == now)

    def publish(self, data: bytes, now: int) -> None:
        with self._memory.lock():
            self._memory.buffer[: len(data)] = data
            self._memory.stamp(now)
        self._memory.notify_all()

    def until_recorded(self, is_it: Callable[[Envelope], bool], patience: float = PATIENCE) -> bool:
        deadline = time.monotonic() + patience
        while not any(map(is_it, read_envelopes(self._path))):
            if time.monotonic() > deadline:
                assert patience < PATIENCE, "a picture was not recorded"
                return False
            time.sleep(0.005)
        return True

    def warm_up(self, begin: int) -> None:
        """Pictures before the drive, until the recorder has found the memory and takes one."""
        for number in range(100, 0, -1):
            self.publish(bytes(self._memory.size), begin - number * 100_000)
            if self.until_recorded(lambda envelope: envelope.data_type == IMAGE, 0.1):
                return
        raise AssertionError("the recorder does not find the memory")


def recorded(cid: int, folder: Path, path: Path, *flags: str) -> OnTheBus:
    maker = program()
    maker.DRIVE_S = SECONDS
    width, height = maker.SIZE
    name = f"drive-{os.getpid()}.i420"
    options = (f"--cid={cid}", f"--rec={path}", "--frames=10", f"--memories={name}:{width}x{height}", *flags)
    with (
        SharedMemory.create(name, width * height * 3 // 2) as memory,
        Session(cid) as session,
        running("rec_recorder", folder, *options),
    ):
        bus = OnTheBus(session, memory, path)
        bus.warm_up(maker.BEGIN)
        maker.drive(bus)
        bus.until_recorded(lambda envelope: key(envelope) == bus.said[-1])
    return bus


def replayed(cid: int, folder: Path, path: Path, begin: int) -> tuple[list[Key], Shown]:
    """Messages and pictures of the drive itself, without those before it."""
    name = f"replay-{os.getpid()}.i420"
    heard: list[Key] = []
    flags = (f"--cid={cid}", f"--rec={path}", f"--name.i420={name}", f"--name.argb={name}.argb", "--timemod=2")
    with Session(cid) as session, running("rec_replay", folder, *flags), Viewer(name) as viewer:
        time.sleep(0.1)
        send(session, "dodo.TestBegin")
        while not heard or heard[-1][0] != END:
            envelope = session.receive(PATIENCE)
            assert envelope is not None, f"no end came after {len(heard)} messages"
            if envelope.data_type != STATUS:
                heard.append(key(envelope))
    once = dict.fromkeys(viewer.seen)  # whoever still waits at the end is woken, and sees the last picture again
    return heard[:-1], [(data, now) for data, now in once if now >= begin]


def psnr(one: bytes, other: bytes) -> float:
    difference = np.frombuffer(one, np.uint8).astype(np.float32) - np.frombuffer(other, np.uint8)
    error = float(np.mean(difference**2))
    return math.inf if error == 0 else 10 * math.log10(255**2 / error)


@pytest.mark.realtime
@pytest.mark.parametrize(
    "flags",
    [
        pytest.param(("--lossless",), id="lossless"),
        pytest.param((), id="default-quality", marks=pytest.mark.proof),  # see test_pictures of rec_recorder
    ],
)
def test_a_drive_recorded_and_replayed(cid: int, tmp_path: Path, flags: tuple[str, ...]) -> None:
    path = tmp_path / "drive.rec"
    drive = recorded(cid, tmp_path, path, *flags)
    kept = [key(envelope) for envelope in read_envelopes(path) if envelope.data_type != IMAGE]
    heard, seen = replayed(cid, tmp_path, path, drive.shown[0][1])
    assert len(drive.said) == 4 * PICTURES and len(drive.shown) == PICTURES
    assert drive.said == kept == heard
    assert [now for _, now in seen] == [now for _, now in drive.shown]
    if flags:
        assert seen == drive.shown
    else:
        quality = [psnr(one, other) for (one, _), (other, _) in zip(seen, drive.shown, strict=True)]
        print(f"PSNR {min(quality):.1f} to {max(quality):.1f} dB")
        assert LEAST_PSNR < min(quality) < math.inf
