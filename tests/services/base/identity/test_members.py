"""Services of a test know each other's addresses; the application cannot become one of them."""

import json
import math
from pathlib import Path

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base.clock import RealTimeClock
from services.base.loop import Loop
from services.base.members import VARIABLE, Members, SenderTable
from services.base.service import Service
from tests.services.base.identity.conftest import Join

FRAME = "opendlv.sim.Frame"


@pytest.fixture(autouse=True)
def producers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "opendlv.sim.Frame/0=pose opendlv.sim.KinematicState/0=own?")


def admitted(session: Session, members: Members) -> list[bool]:
    """For each message on the bus whether it counts."""
    found = []
    while (envelope := session.receive(0.0)) is not None:
        found.append(members.admits(envelope))
    return found


def send(session: Session, name: str = FRAME, stamp: int = 0) -> None:
    session.send(session.messages.type(name)(), 1, stamp)


def test_a_service_that_does_not_say_its_address_is_believed(enter: Join, capsys: pytest.CaptureFixture[str]) -> None:
    track, own = enter("track"), enter("stranger", False)[0]
    send(own, "opendlv.sim.KinematicState")
    assert admitted(*track) == [True]
    said = enter("own")[0]
    for sender in (said, own):
        send(sender, "opendlv.sim.KinematicState")
    assert admitted(*track) == [True, False]


STEERING = "opendlv.proxy.GroundSteeringRequest"
BOX = "opendlv.logic.perception.DetectionBoundingBox"


class Taking(Service):
    """Takes any of these messages."""

    def __init__(self) -> None:
        names = (FRAME, STEERING, BOX, "opendlv.sim.KinematicState", "opendlv.logic.sensation.Geolocation")
        self.inputs = {(name, None): lambda _message, _time: None for name in names}


@pytest.mark.parametrize(
    ("sender", "message", "fields", "said"),
    [
        ("stranger", STEERING, {"groundSteering": math.nan}, "groundSteering is nan"),
        ("stranger", STEERING, {"groundSteering": 0.1}, ""),
        ("dodo-lines", STEERING, {"groundSteering": math.inf}, "groundSteering is inf"),
        ("stranger", BOX, {"x": 0.5, "width": -math.inf, "height": math.nan}, "width is -inf"),
        ("stranger", "opendlv.logic.sensation.Geolocation", {"latitude": math.nan}, "latitude is nan"),
        ("pose", FRAME, {"x": math.nan}, ""),
        ("pose", BOX, {"x": math.nan}, ""),
        ("own", "opendlv.sim.KinematicState", {"vx": math.nan}, ""),
    ],
)
def test_a_number_that_is_not_finite_fails_the_application_that_sent_it(
    enter: Join, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    sender: str, message: str, fields: dict[str, float], said: str,
) -> None:  # fmt: skip
    """In real time; it is said once. A service's own, and a replayed one, are not the application's."""
    printed = f"{STEERING}/0=dodo-lines " if sender == "dodo-lines" else ""
    monkeypatch.setenv(VARIABLE, f"{printed}opendlv.sim.Frame/0=pose opendlv.sim.KinematicState/0=own?")
    session, members = enter("track")
    source = enter("dodo-runner" if printed else sender, sender not in ("stranger", "own"))[0]
    loop = Loop("track", Taking(), session, RealTimeClock(), 0, members)
    for time in (1, 2):
        source.send(source.messages.type(message)(**fields), time)
        envelope = session.receive(5.0)
        assert envelope is not None
        loop.handle(envelope)
    sentence = f"the application sent {message}/0 to 'track' before the test began: {said}, not a finite number"
    out = [json.loads(line)["reason"] for line in capsys.readouterr().out.splitlines()]
    assert out == ([sentence] if said else [])


def test_what_the_application_prints_comes_from_the_runner_alone(
    enter: Join, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Which sends nothing else of services from there."""
    monkeypatch.setenv(VARIABLE, f"{STEERING}/0=dodo-lines opendlv.sim.Frame/0=pose")
    enter("pose")
    session, members = enter("track")
    runner, application = enter("dodo-runner")[0], enter("dodo-runner", False)[0]
    for sender in (runner, application):
        send(sender, STEERING)
    assert admitted(session, members) == [True, False]
    send(runner, FRAME)
    assert admitted(session, members) == [False]
    assert [json.loads(line)["reason"] for line in capsys.readouterr().out.splitlines()] == [
        f"the application sent {STEERING}/0, which it declares to print (x-dodo: lines)",
        "the application sent opendlv.sim.Frame/0, which only 'pose' may send",
    ]


def test_who_may_end_the_input_alone_may_say_what_was_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "dodo.EndOfInput=camera,drive")
    messages = MessageSet.standard()
    table = SenderTable(messages)
    told = table.by_message[messages.id("dodo.NotShown"), None]
    assert (told.services, told.reason) == (
        ("camera", "drive"), "the application sent dodo.NotShown, which only 'camera' and 'drive' may send",
    )  # fmt: skip


MESSAGES = MessageSet.standard()


def loaded(monkeypatch: pytest.MonkeyPatch, text: str) -> SenderTable:
    monkeypatch.setenv(VARIABLE, text)
    return SenderTable(MESSAGES)


def of(name: str, stamp: int) -> Envelope:
    return Envelope(MESSAGES.id(name), b"", 0, 0, 0, stamp)


def test_the_runner_is_known_by_its_address(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runner, other = ("10.0.0.1", 40_000), ("10.0.0.1", 40_001)
    monkeypatch.setenv(CHANNEL_VARIABLE, str(tmp_path))
    table, begin = loaded(monkeypatch, ""), of("dodo.TestBegin", 0)
    address_book.enter(tmp_path, "dodo-runner", runner)
    assert table.is_of_runner(of("opendlv.sim.Frame", 0), other)
    assert table.is_of_runner(begin, runner)
    assert not table.is_of_runner(begin, other)
    (line,) = capsys.readouterr().out.splitlines()
    reason = "the application sent dodo.TestBegin, which only the runner may send"
    assert json.loads(line) == {"dodo": "foreign", "reason": reason}
    assert not table.is_of_runner(of("dodo.Alive", 0), runner), "signs of life have an address of their own"
