"""What the clock reports to the runner."""

import json
import math
from pathlib import Path
from typing import cast

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import Context
from services.base.flags import load_manifest, parse
from services.base.members import VARIABLE, SenderTable
from services.clock import exchange
from services.clock.answers import AnsweringApplication
from services.clock.exchange import Exchange
from services.clock.service import ClockService
from tests.services.process import ROOT


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the services of the test meet."""
    monkeypatch.setenv(CHANNEL_VARIABLE, str(tmp_path))
    return tmp_path


def clock(session: Session, *flags: str) -> ClockService:
    known = parse(load_manifest(ROOT / "services" / "clock"), ["--cid=1", "--timeout=1", *flags])
    return ClockService(Context("clock", known, session.messages, session=session))


def driven(session: Session, *flags: str, stopped: bool = False) -> None:
    service = clock(session, *flags)
    assert service.drive is not None
    service.drive(lambda: stopped)


def test_a_service_that_does_not_answer_is_reported(
    cid: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(exchange, "START_PATIENCE", 0.1)
    reason = "service 'gone' did not connect to the clock within 0.1 s"
    with Session(cid) as session:
        driven(session, "--judge=gone")
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == [
        {"dodo": "stopped", "how": "stuck", "reason": reason, "silent": False},
    ]


def test_who_is_stopped_before_the_begin_reports_no_time(cid: int, capsys: pytest.CaptureFixture[str]) -> None:
    with Session(cid) as session:
        driven(session, stopped=True)
    assert "time" not in capsys.readouterr().out


@pytest.mark.thorough
def test_without_a_runner_it_begins_by_itself(
    cid: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As with ``docker compose up`` on a compiled test."""
    monkeypatch.setenv("DODO_RUNNER", "")
    with Session(cid) as session:
        driven(session)
    assert [json.loads(line)["dodo"] for line in capsys.readouterr().out.splitlines()] == ["time", "time"]


@pytest.mark.thorough
def test_the_begin_comes_to_its_own_address_and_nothing_else_does(
    cid: int, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An application must not answer where only the clock hears it; it waits for the runner."""
    with Session(cid) as session, Session(cid) as other:
        session.hear_directly()
        other.send_directly(enveloped("opendlv.proxy.GroundSteeringRequest"), [session.address])
        other.send_directly(enveloped("dodo.TestBegin"), [session.address])
        address_book.enter(folder, "dodo-runner", other.address)
        driven(session)
        assert not session.hears_directly
    told = [json.loads(line)["dodo"] for line in capsys.readouterr().out.splitlines()]
    assert told == ["started", "time", "time"]


def enveloped(name: str) -> Envelope:
    messages = MessageSet.standard()
    return Envelope(messages.id(name), messages.encode(messages.type(name)()), 0, 0, 0, 0)


STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"


def test_an_answer_that_is_printed_comes_from_the_runner_alone(
    cid: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runner, other = ("10.0.0.1", 40_000), ("10.0.0.1", 40_001)
    with Session(cid) as session:
        ids = session.messages.id(STEERING), session.messages.id("opendlv.sim.Frame")
        monkeypatch.setenv(VARIABLE, f"{STEERING}/0=dodo-lines opendlv.sim.Frame/0=pose")
        taken: list[int] = []
        senders = SenderTable(session.messages)
        link = Exchange(session, tmp_path / ".clock", (), lambda e: taken.append(e.sample_time), lambda: False, senders)
        link.close()  # its bus stays
        address_book.enter(tmp_path, "dodo-runner", runner)
        link.hear(Envelope(ids[0], b"", 1, 0, 5, 0), runner)
        assert (taken, capsys.readouterr().out) == ([5], "")
        link.hear(Envelope(ids[0], b"", 1, 0, 6, 0), other)
        link.hear(Envelope(ids[1], b"", 1, 0, 7, 0), runner)
    assert taken == [5]
    assert [json.loads(line)["reason"] for line in capsys.readouterr().out.splitlines()] == [
        f"the application sent {STEERING}/0, which it declares to print (x-dodo: lines)",
        "the application sent opendlv.sim.Frame/0, which only 'pose' may send",
    ]


def test_a_number_of_the_application_that_is_not_finite_is_reported_once(
    cid: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of what services take, and of no other message or sender stamp; the answer counts as before."""
    with Session(cid) as session:
        steering, pedal = (session.messages.id(name) for name in (STEERING, PEDAL))
        it = clock(session, f"--answers={STEERING}/0", f"--hears={PEDAL}", "--advance=vehicle", "--judge=track")
        it._exchange.close()
        it._stepper._consumed = {"track": frozenset({steering}), "vehicle": frozenset({steering})}
        it._stepper.now += 700_000
        answers = cast(AnsweringApplication, it._application)
        answers.expect([5])
        sent = [(steering, math.nan, 7), (pedal, math.nan, 0), *[(steering, -math.inf, 0)] * 2]
        for id_, value, stamp in sent:
            message = session.messages.type(session.messages.name(id_))()
            setattr(message, message.DESCRIPTOR.fields[0].name, value)
            it._take(Envelope(id_, session.messages.encode(message), 5, 0, 5, stamp))
        assert not answers.missing()
    assert [json.loads(line)["reason"] for line in capsys.readouterr().out.splitlines()] == [
        f"the application sent {STEERING}/0 to 'vehicle' and 'track' after 0.70 s: "
        "groundSteering is -inf, not a finite number"
    ]
