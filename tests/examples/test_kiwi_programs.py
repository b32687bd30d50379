"""The two programs of the example application as processes, on a real bus and with real shared memory."""

import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory

FOLDER = Path(__file__).parents[2] / "examples" / "kiwi"
WIDTH, HEIGHT = 640, 480
YELLOW, BLUE, GREY = (0, 217, 255), (230, 38, 0), (104, 104, 104)
PATIENCE = 20.0
DETECTION = ("DetectionType", "DetectionProperty", "DetectionBoundingBox")
ANSWER = ("GroundSteeringRequest", "PedalPositionRequest")
WHOLE = ("ImageReadingShm", *ANSWER)
SAMPLED = 1_700_000_000_123_456


def picture(*cones: tuple[tuple[int, int, int], int, int]) -> Any:
    """A grey image with boxes of 20 x 40 pixels, each a colour and its upper left corner."""
    image = np.full((HEIGHT, WIDTH, 4), (*GREY, 255), np.uint8)
    for colour, x, y in cones:
        image[y : y + 40, x : x + 20, :3] = colour
    return image


class Rig:
    """The camera's side: shared memory to show pictures in and the bus to hear what is made of them."""

    def __init__(self, cid: int, name: str) -> None:
        self.cid, self.name = cid, name
        self.session = Session(cid)
        self.programs: list[subprocess.Popen[bytes]] = []

    def start(self, program: str, *flags: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, f"{program}.py", f"--cid={self.cid}", *flags]
        self.programs.append(subprocess.Popen(command, cwd=FOLDER, stdout=subprocess.PIPE, stderr=subprocess.PIPE))
        return self.programs[-1]

    def show(self, memory: SharedMemory, image: Any, sampled: int) -> None:
        deadline = time.monotonic() + PATIENCE
        while not memory.readers_waiting():
            assert time.monotonic() < deadline, "perception does not wait for a frame"
            time.sleep(0.005)
        with memory.lock():
            memory.buffer[:] = image.tobytes()
            memory.stamp(sampled)
            memory.notify_all()  # within the lock: a reader that comes back early would be woken twice

    def hear(self, *until: str) -> list[tuple[str, int, Any]]:
        """Messages until each of some names was heard: each its short name, sample time and content.

        Only those of one sender are in order: an answer can come before the question that a third one asked.
        """
        heard: list[tuple[str, int, Any]] = []
        while set(until) - {name for name, _, _ in heard}:
            envelope = self.session.receive(PATIENCE)
            assert envelope is not None, f"not all of {until} came"
            message = self.session.messages.decode(envelope.data_type, envelope.payload)
            if message.DESCRIPTOR.name in (*DETECTION, *ANSWER, *until):
                heard.append((message.DESCRIPTOR.name, envelope.sample_time, message))
        return sorted(heard, key=lambda item: item[0] in ANSWER)

    def close(self) -> None:
        for process in self.programs:
            process.kill()
            process.communicate()
        self.session.close()


@pytest.fixture
def rig(cid: int) -> Iterator[Rig]:
    rig = Rig(cid, f"dodo-test-{uuid.uuid4().hex}.argb")
    yield rig
    rig.close()


def size() -> tuple[str, str]:
    return f"--width={WIDTH}", f"--height={HEIGHT}"


@pytest.mark.thorough
def test_a_frame_is_announced_with_its_sample_time_and_answered_once(rig: Rig) -> None:
    rig.start("steering")
    rig.start("perception", f"--name={rig.name}", *size(), "--await-steering")
    with SharedMemory.create(rig.name, WIDTH * HEIGHT * 4) as memory:
        rig.show(memory, picture((YELLOW, 100, 280), (BLUE, 520, 280)), SAMPLED)
        heard = rig.hear(*WHOLE)
        assert {sampled for _, sampled, _ in heard} == {SAMPLED}
        assert [name for name, _, _ in heard] == [*DETECTION, *DETECTION, *WHOLE]
        messages = [message for _, _, message in heard]
        assert [(m.sampleId, m.detectionId, m.type) for m in messages[0:6:3]] == [(0, 0, 1), (0, 1, 2)]
        assert [m.property for m in messages[1:6:3]] == ["yellow", "blue"]
        box = messages[2]
        assert (box.x, box.y, box.width, box.height) == pytest.approx((100 / 640, 280 / 480, 20 / 640, 40 / 480))
        assert messages[7].groundSteering == pytest.approx(0, abs=1e-6)
        assert 0 < messages[8].position <= 0.14

        rig.show(memory, picture((YELLOW, 10, 280), (BLUE, 430, 280)), SAMPLED + 100_000)
        heard = rig.hear(*WHOLE)
        assert {sampled for _, sampled, _ in heard} == {SAMPLED + 100_000}
        left = heard[-2][2].groundSteering
        assert left > 0.01

        rig.show(memory, picture(), SAMPLED + 200_000)
        assert [name for name, _, _ in rig.hear(*WHOLE)] == [*WHOLE]


@pytest.mark.parametrize("program", ["perception", "steering"])
@pytest.mark.thorough
def test_sigterm_ends_a_program_cleanly(rig: Rig, program: str) -> None:
    programs = {
        "steering": rig.start("steering", "--verbose"),
        "perception": rig.start("perception", f"--name={rig.name}", *size(), "--await-steering", "--verbose"),
    }
    with SharedMemory.create(rig.name, WIDTH * HEIGHT * 4) as memory:
        rig.show(memory, picture(), SAMPLED)
        process = programs[program]
        assert process.stdout is not None
        assert any(line.startswith(b"frame 0: ") for line in process.stdout)
        process.send_signal(signal.SIGTERM)
        output, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, output, errors) == (0, b"", b"")
