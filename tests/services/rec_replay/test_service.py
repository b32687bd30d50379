import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.video import VideoEncoder
from services.base import Output
from services.rec_replay.service import Replay
from tests.services.built import built, refusal
from tests.services.process import PATIENCE, running, send
from tests.services.rec_replay.recordings import HEIGHT, IMAGE, T0, WIDTH, S, images, message, picture, write
from tests.services.rec_replay.viewer import Viewer

STATUS, END = 10, 2901
BEGIN = 1_700_000_000 * S
PEDAL = "opendlv.proxy.PedalPositionRequest"


def pedals(times: list[float]) -> list[Envelope]:
    return [message(PEDAL, time, position=number) for number, time in enumerate(times)]


def until_end(session: Session) -> list[Envelope]:
    """What is played, without the player's status."""
    heard: list[Envelope] = []
    while not heard or heard[-1].data_type != END:
        envelope = session.receive(PATIENCE)
        assert envelope is not None, f"no end came after {len(heard)} messages"
        if envelope.data_type != STATUS:
            heard.append(envelope)
    return heard[:-1]


def key(envelope: Envelope) -> tuple[int, bytes, int, int, int]:
    return envelope.data_type, envelope.payload, envelope.sent, envelope.sample_time, envelope.sender_stamp


class Stage:
    """A player in this process, in test time: `heard` are the envelopes with the time (us) at which they were sent."""

    def __init__(self, service: Replay) -> None:
        self.service, self.now = service, BEGIN
        self.heard: list[tuple[int, Envelope]] = []
        self.status: list[Any] = []

    def run(self, seconds: float) -> None:
        """Updates at the player's rate, until its input ends at most."""
        end = self.now + round(seconds * S)
        while self.now < end and not self.service.finished:
            for each in self.service.update(self.now):
                if isinstance(each, Output):
                    self.status.append(each.message)
                else:
                    self.heard.extend((self.now - BEGIN, envelope) for envelope, _ in each)
            self.now += 1000

    @property
    def positions(self) -> list[float]:
        decode = MessageSet.standard().decode
        return [decode(each.data_type, each.payload).position for _, each in self.heard]


@contextmanager
def staged(rec: Path, *flags: str) -> Iterator[Stage]:
    with built("rec_replay", f"--rec={rec}", *flags) as service:
        yield Stage(service)


def test_messages_come_when_the_test_begins_and_then_the_input_ends(tmp_path: Path) -> None:
    played = pedals([0, 0.1, 0.3])
    with staged(write(tmp_path / "drive.rec", played), "--settle=0.1") as stage:
        stage.run(0.2)
        assert stage.heard == [] and stage.status
        stage.service.begin(stage.now)
        stage.run(9)
    assert [key(e) for _, e in stage.heard] == [key(e) for e in played]
    assert [time for time, _ in stage.heard] == pytest.approx([200_000, 300_000, 500_000], abs=1000)
    assert stage.service.finished and stage.now - BEGIN == pytest.approx(600_000, abs=3000)


def test_sample_times_of_the_test(tmp_path: Path) -> None:
    with staged(write(tmp_path / "drive.rec", pedals([0, 0.1, 0.3])), "--settle=0", "--sample-times=test") as stage:
        stage.service.begin(stage.now)
        stage.run(9)
    assert [e.sample_time - BEGIN for _, e in stage.heard] == [0, S // 10, 3 * S // 10]
    assert all(e.sent == e.sample_time for _, e in stage.heard)


def test_it_repeats(tmp_path: Path) -> None:
    for number, times in enumerate(([0, 0.01, 0.02], [0])):  # also a part without duration
        rec = write(tmp_path / f"{number}.rec", pedals(times))
        with staged(rec, "--autorewind", "--await-begin=false") as stage:
            stage.run(0.2)
        assert stage.positions[:12] == [*range(len(times))] * (12 // len(times)) and not stage.service.finished


def test_recordings_that_cannot_be_played(tmp_path: Path) -> None:
    empty, garbage = tmp_path / "empty.rec", tmp_path / "garbage.rec"
    empty.touch()
    garbage.write_bytes(b"no recording at all")
    undecodable = write(tmp_path / "undecodable.rec", images([0, 0.1])[1:])
    problems = {
        empty: f"{empty} is empty: there is nothing to play",
        garbage: f"{garbage} is not a recording: its 19 bytes hold no message",
        undecodable: f"none of the 1 pictures in {undecodable} can be decoded: there is no key frame among them",
        tmp_path / "none.rec": f"[Errno 2] No such file or directory: '{tmp_path / 'none.rec'}'",
    }
    for path, problem in problems.items():
        assert refusal("rec_replay", f"--rec={path}") == problem


def test_damage_and_missing_pictures_are_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rec = write(tmp_path / "drive.rec", pedals([0, 0.1]))
    rec.write_bytes(rec.read_bytes() + b"\x0d\xa4cut")
    with staged(rec, "--await-begin=false", "--settle=0") as stage:
        stage.run(9)
    assert len(stage.heard) == 2
    assert f"{rec}: skipped 5 bytes at byte" in caplog.text
    assert "has no pictures of sender 0 in the selected part: no memory is created" in caplog.text


@pytest.mark.realtime
def test_pictures_with_their_sample_times(cid: int, tmp_path: Path) -> None:
    times = [n / 20 for n in range(12)]
    rec = write(tmp_path / "drive.rec", [*images(times), *images([0, 0.1], sender_stamp=3)])
    names = {kind: f"replay-{os.getpid()}.{kind}" for kind in ("argb", "i420")}
    flags = (f"--cid={cid}", f"--rec={rec}", *(f"--name.{kind}={name}" for kind, name in names.items()))
    with (
        Session(cid) as session,
        running("rec_replay", tmp_path, *flags),
        Viewer(names["i420"]) as i420,
        Viewer(names["argb"]) as argb,
    ):
        time.sleep(0.1)
        send(session, "dodo.TestBegin")
        i420.wait_for(len(times))
        argb.wait_for(len(times))
    assert i420.seen == [(picture(n).tobytes(), T0 + round(t * S)) for n, t in enumerate(times)]
    assert [sampled for _, sampled in argb.seen] == [sampled for _, sampled in i420.seen]
    assert all(data[3::4] == b"\xff" * (len(data) // 4) for data, _ in argb.seen)


@pytest.mark.realtime
def test_every_message_of_real_recordings(cid: int, tmp_path: Path, shared_data: Callable[[str], Path]) -> None:
    rec = shared_data("sim-2023-04-27.rec")
    flags = (f"--cid={cid}", f"--rec={rec}", "--timemod=50", "--settle=0", "--await-begin=false")
    with Session(cid) as session, running("rec_replay", tmp_path, *flags):
        heard = until_end(session)
    with Recording(rec) as recording:
        rows = np.argsort(recording.index["time"], kind="stable")
        assert [key(e) for e in heard] == [key(e) for e in recording.envelopes(rows)]


@pytest.mark.parametrize(("times", "zero"), [("recorded", T0), ("test", BEGIN)])
def test_what_cannot_be_shown_is_told_with_the_time_until_the_next_frame(times: str, zero: int, tmp_path: Path) -> None:
    """Two frames before a key frame, a damaged one, one of another size, and one of an unknown format at the end."""
    frames = images([0, 1, 2, 3, 4, 5, 6, 7, 8])
    damaged = message(IMAGE, 5, data=b"x", format="h264", width=WIDTH, height=HEIGHT)
    small = VideoEncoder("i420", 32, 32, 1, lossless=True).encode(pixels.view(np.zeros(1536, np.uint8), "i420", 32, 32))
    other = message(IMAGE, 6, data=small, format="h264", width=32, height=32)
    unknown = message(IMAGE, 9, data=b"x", format="unknown", width=WIDTH, height=HEIGHT)
    rec = write(tmp_path / "part.rec", [*frames[2:5], damaged, other, frames[8], unknown])
    with staged(rec, "--start=0", "--timemod=2", f"--sample-times={times}") as stage:
        stage.service.begin(stage.now)
        stage.run(6)
    told = [each for each in stage.status if each.DESCRIPTOR.name == "NotShown"]
    sampled = [((each.sampled - zero) / S, (each.sampledUntil - each.sampled) / S) for each in told]
    due = [each.dueUntil / S - BEGIN / S for each in told[:-1]]
    assert [each.number for each in told] == [0, 1, 3, 4, 6]
    if times == "recorded":
        assert sampled == [(2, 1), (3, 1), (5, 1), (6, 2), (9, 86_400)]
    else:
        assert sampled == [(pytest.approx(at, abs=0.01), pytest.approx(for_, abs=0.01)) for at, for_ in
                           [(0, 0.5), (0.5, 0.5), (1.5, 0.5), (2, 0.5), (3, 86_400)]]  # fmt: skip
    assert due == pytest.approx([0.5, 1, 2, 2.5], abs=0.01)
    assert stage.service.notes == [
        "5 frames could not be shown, 2 of them before the first key frame, 1 of them of another size than the first"
    ]
