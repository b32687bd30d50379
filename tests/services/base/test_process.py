"""The tiny service as a process on a real bus."""

import subprocess
import sys
import uuid
from itertools import pairwise
from pathlib import Path

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address_book import AddressBook
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
from tests.services.base.conftest import ROOT, Start

MESSAGES = MessageSet.standard()
READY = {"dodo": "ready"}
BEGIN = MESSAGES.type("dodo.TestBegin")
END = MESSAGES.type("dodo.EndOfInput")
DISTANCE = MESSAGES.type("opendlv.proxy.DistanceReading")
PEDAL, ANGLE, VOLTAGE = 1086, 1038, 1037


def heard(session: Session, data_type: int) -> Envelope:
    while True:
        envelope = session.receive(20.0)
        assert envelope is not None, f"no message {data_type}"
        if envelope.data_type == data_type:
            return envelope


def test_ready_means_that_session_and_memory_are_there(start: Start, tmp_path: Path) -> None:
    name, book = f"dodo-test-{uuid.uuid4().hex}", AddressBook(tmp_path)
    address_book.enter(tmp_path, "tiny", ("10.0.0.1", 1))  # of one that was killed
    service = start("--role=echo", f"--name={name}", DODO_SERVICE="tiny", DODO_CHANNEL=str(tmp_path))
    assert service.line() == READY
    book.read()
    assert book.present == {book.addresses["tiny"]} != {("10.0.0.1", 1)}
    with SharedMemory.attach(name) as memory:
        assert memory.size == 100
    service.stop()
    assert service.end() == (0, "", "")
    book.read()
    assert not (book.present or Path("/tmp", name).exists())


def test_steps_are_even_and_stamped_with_test_time(start: Start, cid: int) -> None:
    with Session(cid) as session:
        start("--role=echo", "--freq=100", "--id=5")
        pedals = [heard(session, PEDAL) for _ in range(5)]
    assert {envelope.sender_stamp for envelope in pedals} == {5}
    times = [envelope.sample_time for envelope in pedals]
    assert all(later > earlier and (later - earlier) % 10_000 == 0 for earlier, later in pairwise(times))
    assert all(envelope.sample_time <= envelope.sent for envelope in pedals)


def test_messages_come_with_their_sample_time_and_from_the_right_sender(start: Start, cid: int) -> None:
    with Session(cid) as session:
        assert start("--role=echo", "--freq=20").line() == READY
        session.send_envelope(Envelope(1039, b"\x0d\x00", 0, 0, 0, 2))  # malformed, to be left
        session.send(BEGIN(), sample_time=1_000)
        session.send(DISTANCE(distance=0.5), sample_time=64, sender_stamp=2)
        session.send(DISTANCE(distance=9.0), sample_time=32, sender_stamp=3)
        while (pedal := MESSAGES.decode(PEDAL, heard(session, PEDAL).payload).position) == 0.0:
            pass
        angle = heard(session, ANGLE)
    assert pedal == 0.5
    assert angle.sender_stamp == 7
    assert MESSAGES.decode(ANGLE, angle.payload).angle == 1_064


def test_a_message_decides(start: Start, cid: int) -> None:
    with Session(cid) as session:
        service = start("--role=judge")
        assert service.line() == READY
        session.send(DISTANCE(distance=0.5))
        session.send(DISTANCE(distance=1.5))
        session.send(END())
        assert service.line() == {
            "dodo": "verdict",
            "outcome": "failed",
            "reason": "too far",
            "checks": [{"name": "range", "value": 1.5, "limit": {"max": 1.0}, "unit": "m", "ok": False}],
        }
    assert service.end() == (0, "", "")


def test_what_was_judged_comes_before_the_verdict_and_without_one(start: Start, cid: int, tmp_path: Path) -> None:
    """In a test, whose folder the service has; else, as above, nobody reads it."""
    about = {"series": "Distance", "unit": "m", "exclusive": False, "high": 1}
    about |= dict.fromkeys(("low", "distance", "band"))
    with Session(cid) as session:
        service = start("--role=judge", DODO_CHANNEL=str(tmp_path))
        assert service.line() == READY
        session.send(DISTANCE(distance=1.5), sample_time=7)
        assert service.line() == {"dodo": "judged", **about}
        samples = service.line()
        assert (samples["samples"], samples["zero"], samples["marks"]) == ("Distance", 7, "Ag==")
        assert service.line()["dodo"] == "verdict"
        assert service.end() == (0, "", "")
        stopped = start("--role=judge", DODO_CHANNEL=str(tmp_path))
        assert stopped.line() == READY
        stopped.stop()
        assert stopped.line() == {"dodo": "judged", **about}
        assert stopped.end() == (0, "", "")


@pytest.mark.thorough
def test_a_source_that_runs_out_ends_the_judge(start: Start, cid: int) -> None:
    with Session(cid) as session:
        judge = start("--role=judge", "--verbose")
        assert judge.line() == READY
        source = start("--role=source", DODO_SERVICE="beacons")
        voltages = [MESSAGES.decode(VOLTAGE, heard(session, VOLTAGE).payload).voltage for _ in range(3)]
        assert voltages == [1.0, 2.0, 3.0]
        assert MESSAGES.decode(2901, heard(session, 2901).payload).source == "beacons"
    assert source.end() == (0, '{"dodo": "ready"}\n{"dodo": "end-of-input"}\n', "")
    assert judge.line()["checks"] == [{"name": "distance", "value": None, "limit": {}, "unit": "", "ok": True}]
    code, out, err = judge.end()
    assert (code, out) == (0, "")
    assert "DEBUG: the end has come" in err


def test_messages_under_another_stamp_are_noted(start: Start, cid: int) -> None:
    with Session(cid) as session:
        service = start("--role=echo")
        assert service.line() == READY
        for _ in range(3):
            session.send(DISTANCE(distance=1.0), 1, 99)
        session.send(BEGIN(), 77)
        while MESSAGES.decode(ANGLE, heard(session, ANGLE).payload).angle != 77:
            pass
    service.stop()
    text = "no opendlv.proxy.DistanceReading/2 came, but 3 with sender stamp 99"
    assert service.line() == {"dodo": "note", "text": text}


@pytest.mark.parametrize(
    ("role", "text"),
    [
        ("broken", "ZeroDivisionError: a model went wrong"),
        ("library", "JSONDecodeError: Expecting value: line 1 column 2 (char 1)"),
        ("unjudgeable", "UnjudgeableError: the map has no goal"),
    ],
)
def test_a_model_that_fails(start: Start, role: str, text: str) -> None:
    code, out, err = start(f"--role={role}").end()
    assert (code, out) == (1, '{"dodo": "ready"}\n')
    *steps, last = err.splitlines()
    assert last == f"tiny-service: CRITICAL: {text}"
    assert bool(steps) == (role != "unjudgeable") == any("Traceback" in line for line in steps)


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        (["--role=unbuildable"], "tiny-service: CRITICAL: /no/such/map: cannot be read\n"),
        (["--role=echo", "--frq=1"], "tiny-service: unrecognized arguments: --frq=1\n"),
    ],
)
def test_flags_that_cannot_be_met(start: Start, flags: list[str], text: str) -> None:
    assert start(*flags).end() == (2, "", text)


def test_memory_that_another_process_has(start: Start) -> None:
    name = f"dodo-test-{uuid.uuid4().hex}"
    with SharedMemory.create(name, 10):
        code, out, err = start("--role=echo", f"--name={name}").end()
        assert (code, out) == (2, "")
        assert f"shared memory '{name}' cannot be made: process" in err
        assert Path("/tmp", name).exists()


def test_starting_up_is_light() -> None:
    code = "import sys, services.base; print(sorted({'numpy', 'cv2', 'jsonschema'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
