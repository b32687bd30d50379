"""Truth comes to the bus when the application's answer no longer counts, and in lockstep never."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.base.clock import RealTimeClock
from services.base.loop import Loop
from services.base.service import Output, Service
from services.base.withheld import VARIABLE, WithheldTruth

BOX, OTHER = "opendlv.logic.perception.DetectionBoundingBox", "opendlv.proxy.DistanceReading"
MESSAGES = MessageSet.standard()


class Teller(Service):
    """Tells the truth once, and something else."""

    period = 10_000

    def __init__(self, updates: int) -> None:
        self._left = updates

    def update(self, now: int) -> list[Output]:
        self._left -= 1
        self.finished = self._left == 0
        return [Output(MESSAGES.type(BOX)(), 9), Output(MESSAGES.type(OTHER)(), 9)]


class Noting(RealTimeClock):
    """Keeps what the service sends."""

    def __init__(self, relays: bool) -> None:
        super().__init__()
        self.relays = relays
        self.said: list[bytes] = []

    def sent(self, frame: bytes) -> None:
        self.said.append(frame)


def heard(cid: int, monkeypatch: pytest.MonkeyPatch, relays: bool, updates: int) -> tuple[list[int], int]:
    """The ids on the bus, and how many messages the clock got."""
    monkeypatch.setenv(VARIABLE, f"0.05 {BOX}/9")
    with Session(cid) as session, Session(cid) as listener:
        clock = Noting(relays)
        Loop("teller", Teller(updates), session, clock, 0).run(lambda: False)
        ids = []
        while (envelope := listener.receive(0.0)) is not None:
            ids.append(envelope.data_type)
    return ids, len(clock.said)


def test_in_real_time_it_comes_late_and_before_the_end_of_the_input(cid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ids, _ = heard(cid, monkeypatch, relays=False, updates=9)
    box, other = MESSAGES.id(BOX), MESSAGES.id(OTHER)
    assert (ids.count(box), ids.count(other), ids[-1]) == (9, 9, 2901)
    assert ids[:5] == [other] * 5
    assert box in ids[: ids.index(2901) - 3], "some of it before the end"


def test_in_lockstep_only_the_clock_gets_it(cid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ids, said = heard(cid, monkeypatch, relays=True, updates=2)
    assert ids == [MESSAGES.id(OTHER)] * 2 + [2901]
    assert said == 5


def test_without_truth_nothing_is_withheld(tmp_path: Path) -> None:
    truth = WithheldTruth.load(MESSAGES)
    assert not truth.holds(Envelope(MESSAGES.id(BOX), b"", 0, 0, 0, 9))
    assert truth.delay == 0
