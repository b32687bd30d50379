import os
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.recordings.recording import Recording, read_envelopes
from tests.services.process import PATIENCE, launch, receive, running, send
from tests.services.rec_replay.recordings import T0, S, images, message, picture, write
from tests.services.rec_replay.viewer import Viewer

STATUS, END = 10, 2901
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


def test_messages_come_when_the_test_begins_and_then_the_input_ends(cid: int, tmp_path: Path) -> None:
    played = pedals([0, 0.1, 0.3])
    rec = write(tmp_path / "drive.rec", played)
    flags = (f"--cid={cid}", f"--rec={rec}", "--settle=0.1")
    with Session(cid) as session, running("rec_replay", tmp_path, *flags) as process:
        early = session.receive(0.2)
        assert early is None or early.data_type == STATUS
        send(session, "dodo.TestBegin")
        heard = until_end(session)
        assert process.wait(PATIENCE) == 0
    assert [key(e) for e in heard] == [key(e) for e in played]
    assert heard[-1].received - heard[0].received > 0.25 * S


def test_sample_times_of_the_test(cid: int, tmp_path: Path) -> None:
    rec = write(tmp_path / "drive.rec", pedals([0, 0.1, 0.3]))
    flags = (f"--cid={cid}", f"--rec={rec}", "--settle=0", "--sample-times=test")
    with Session(cid) as session, running("rec_replay", tmp_path, *flags):
        before = time.time_ns() // 1000
        send(session, "dodo.TestBegin")
        heard = until_end(session)
    times = [e.sample_time for e in heard]
    assert [t - times[0] for t in times] == [0, S // 10, 3 * S // 10]
    assert before - S // 10 <= times[0] <= heard[0].received


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


def test_commands(cid: int, tmp_path: Path) -> None:
    rec = write(tmp_path / "drive.rec", pedals([n * 0.5 for n in range(8)]))
    command = "cluon.data.PlayerCommand"

    def position(session: Session) -> float:
        return float(receive(session, PEDAL)[1].position)

    with Session(cid) as session, running("rec_replay", tmp_path, f"--cid={cid}", f"--rec={rec}", "--timemod=5"):
        for _ in range(2):
            send(session, command, command=4)
        assert [position(session), position(session)] == [0, 1]
        send(session, command, command=3, seekTo=0.75)
        send(session, command, command=4)
        assert position(session) == 6
        _, status = receive(session, "cluon.data.PlayerStatus")
        assert (status.state, status.numberOfEntries, status.currentEntryForPlayback) == (2, 8, 7)
        send(session, command, command=3, seekTo=0.5)
        send(session, command, command=1)
        assert [position(session) for _ in range(4)] == [4, 5, 6, 7]


def test_it_begins_anew(cid: int, tmp_path: Path) -> None:
    rec = write(tmp_path / "drive.rec", pedals([0, 0.01, 0.02]))
    flags = (f"--cid={cid}", f"--rec={rec}", "--autorewind", "--await-begin=false")
    with Session(cid) as session, running("rec_replay", tmp_path, *flags):
        positions = [receive(session, PEDAL)[1].position for _ in range(12)]
    assert [b - a for a, b in pairwise(positions)].count(-2) >= 3


def test_recordings_that_cannot_be_played(cid: int, tmp_path: Path) -> None:
    empty, garbage = tmp_path / "empty.rec", tmp_path / "garbage.rec"
    empty.touch()
    garbage.write_bytes(b"no recording at all")
    others = write(tmp_path / "others.rec", [*pedals([0]), *images([0], sender_stamp=3)])
    undecodable = write(tmp_path / "undecodable.rec", images([0, 0.1])[1:])
    problems = {
        empty: f"{empty} is empty: there is nothing to play",
        garbage: f"{garbage} is not a recording: its 19 bytes hold no message",
        others: f"{others} has no pictures of sender 0, but of 3: set --video-sender",
        undecodable: f"none of the 1 pictures in {undecodable} can be decoded",
        tmp_path / "none.rec": f"[Errno 2] No such file or directory: '{tmp_path / 'none.rec'}'",
    }
    for path, problem in problems.items():
        process = launch("rec_replay", tmp_path, f"--cid={cid}", f"--rec={path}")
        output, errors = process.communicate(timeout=PATIENCE)
        assert (process.returncode, output) == (2, "")
        assert errors.splitlines()[-1] == f"rec-replay: CRITICAL: {problem}"


def test_damage_and_missing_pictures_are_told(cid: int, tmp_path: Path) -> None:
    rec = write(tmp_path / "drive.rec", pedals([0, 0.1]))
    rec.write_bytes(rec.read_bytes() + b"\x0d\xa4cut")
    flags = (f"--cid={cid}", f"--rec={rec}", "--await-begin=false", "--settle=0")
    with Session(cid) as session, running("rec_replay", tmp_path, *flags) as process:
        assert len(until_end(session)) == 2
        errors = process.communicate(timeout=PATIENCE)[1]
    assert f"{rec}: skipped 5 bytes at byte" in errors
    assert "has no pictures in the selected part: no shared memory is created" in errors


def replayed_by_libcluon(cid: int, rec: Path) -> list[Envelope]:
    program = Path(sys.executable).with_name("cluon-replay")
    if not program.exists():
        pytest.skip("cluon-replay is absent")
    with Session(cid) as session:
        sink = subprocess.DEVNULL
        with subprocess.Popen([program, f"--cid={cid}", rec], stdout=sink, stderr=sink) as process:
            heard = []
            while (envelope := session.receive(0.3)) is not None or process.poll() is None:
                if envelope is not None and envelope.data_type != STATUS:
                    heard.append(envelope)
    return heard


def replayed_by_us(cid: int, rec: Path, folder: Path) -> list[Envelope]:
    with Session(cid) as session, running("rec_replay", folder, f"--cid={cid}", f"--rec={rec}", "--settle=0"):
        send(session, "dodo.TestBegin")
        return until_end(session)


def shortened(rec: Path, count: int, target: Path) -> Path:
    """The first messages, so that a test does not last as long as a drive."""
    rows = list(read_envelopes(rec))[:count]
    return write(target, rows)


@pytest.mark.parametrize(("name", "count"), [("sim-2023-04-27.rec", 500), ("cones-2020-05-15.rec", 30)])
def test_the_bus_has_what_cluon_replay_sends(
    cid: int, tmp_path: Path, shared_data: Callable[[str], Path], name: str, count: int
) -> None:
    rec = shortened(shared_data(name), count, tmp_path / name)
    theirs, ours = replayed_by_libcluon(cid, rec), replayed_by_us(cid, rec, tmp_path)
    assert [key(e) for e in ours] == [key(e) for e in theirs]
    assert len(ours) == count


def test_every_message_of_real_recordings(cid: int, tmp_path: Path, shared_data: Callable[[str], Path]) -> None:
    rec = shared_data("sim-2023-04-27.rec")
    flags = (f"--cid={cid}", f"--rec={rec}", "--timemod=50", "--settle=0", "--await-begin=false")
    with Session(cid) as session, running("rec_replay", tmp_path, *flags):
        heard = until_end(session)
    with Recording(rec) as recording:
        assert [key(e) for e in heard] == [key(e) for e in recording.envelopes(recording.by_time())]


def test_every_picture_of_the_track(cid: int, tmp_path: Path, shared_data: Callable[[str], Path]) -> None:
    rec = shared_data("track-1-2025-05-08.rec")
    names = [f"--name.{kind}=track-{os.getpid()}.{kind}" for kind in ("argb", "i420")]
    flags = (f"--cid={cid}", f"--rec={rec}", "--timemod=30", "--settle=0", *names)
    with Session(cid) as session, running("rec_replay", tmp_path, *flags) as process:
        send(session, "dodo.TestBegin")
        assert until_end(session) == []
        errors = process.communicate(timeout=PATIENCE)[1]
    assert "591 pictures were shown" in errors
    assert "could not be decoded" not in errors
