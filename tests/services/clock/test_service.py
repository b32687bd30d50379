"""What the clock reports to the runner."""

import json
from fractions import Fraction

import pytest

from dodo_dsl.opendlv.bus.session import Session
from services.base.lockstep.channel import Channel
from services.clock import model
from services.clock.answers import Answers
from services.clock.participants import Patience, Roles
from services.clock.service import ClockService

STEP = Fraction(100_000)


def driven(session: Session, roles: Roles, stopped: bool = False) -> None:
    channel = Channel(session.cid, session.messages)
    service = ClockService(session, channel, roles, Answers(()), STEP, 1_000_000, Patience(1.0, 1.0))
    assert service.drive is not None
    service.drive(lambda: stopped)
    channel.close()


def test_a_service_that_does_not_answer_is_reported_with_the_progress(
    cid: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(model, "SERVICE_PATIENCE", 0.1)
    with Session(cid) as session, Session(cid) as runner:
        runner.send(runner.messages.type("dodo.TestBegin")())
        driven(session, Roles((), (), ("gone",)))
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == [
        {"dodo": "time", "s": 0.0, "frames": 0, "surplus": 0, "last": False},
        {"dodo": "time", "s": 0.0, "frames": 0, "surplus": 0, "last": True},
        {"dodo": "stuck", "reason": "service 'gone' did not answer the clock within 0.1 s"},
    ]


def test_who_is_stopped_before_the_begin_reports_nothing(cid: int, capsys: pytest.CaptureFixture[str]) -> None:
    with Session(cid) as session:
        driven(session, Roles((), (), ()), stopped=True)
    assert capsys.readouterr().out == ""


def test_without_a_runner_it_begins_by_itself(
    cid: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As with ``docker compose up`` on a compiled test; it then looks for the test's services."""
    monkeypatch.setattr(model, "SERVICE_PATIENCE", 0.1)
    monkeypatch.setenv("DODO_RUNNER", "")
    with Session(cid) as session:
        driven(session, Roles((), (), ("gone",)))
    assert "did not answer the clock within 0.4 s" in capsys.readouterr().out
