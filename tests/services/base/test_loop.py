"""What a service's loop says of stamps, losses, pauses and late updates."""

import contextlib
from fractions import Fraction

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.session import Session
from services.base.clock import RealTimeClock
from services.base.loop import Lateness, Loop
from services.base.service import Service, UnusableMessageError

STEER, PEDAL = 1090, 1086
STEERING = "opendlv.proxy.GroundSteeringRequest"
INPUTS = (STEERING, 0), (STEERING, 9), ("opendlv.proxy.PedalPositionRequest", None)


def strangers(cid: int, *those: tuple[int, int]) -> list[str]:
    """What the loop reports of messages that came, by id and stamp."""
    service = Service()
    service.inputs = dict.fromkeys(INPUTS, lambda *_: None)
    with Session(cid) as session:
        loop = Loop("x", service, session, RealTimeClock(), 0)
        for kind, stamp in those:
            loop.handle(Envelope(kind, b"", 0, 0, 0, stamp))
        return loop.strangers()


def test_what_came_under_another_stamp_is_named(cid: int) -> None:
    assert strangers(cid, *[(STEER, 99)] * 120, (STEER, 9), (STEER, 3), (PEDAL, 5)) == [
        "no opendlv.proxy.GroundSteeringRequest/0 came, but 1 with sender stamp 3 and 120 with sender stamp 99"
    ]


@pytest.mark.parametrize(("those", "told"), [((), 0), ((0, 9, 99), 0), ((9,), 0), ((99,), 2), ((9, 1, 1), 1)])
def test_only_a_stamp_that_never_came_is_told_and_only_beside_strangers(
    cid: int, those: tuple[int, ...], told: int
) -> None:
    assert len(strangers(cid, *((STEER, stamp) for stamp in those))) == told


@pytest.mark.parametrize(("period", "is_good"), [(0.01, False), (0, False), (1.5, False), (1e6, True), (None, True)])
def test_a_period_is_in_microseconds(cid: int, period: float | None, is_good: bool) -> None:
    service = Service()
    service.period = period  # type: ignore[assignment]
    with Session(cid) as session, contextlib.nullcontext() if is_good else pytest.raises(ValueError, match="period_of"):
        Loop("x", service, session, RealTimeClock(), 0)


class Losing(Session):
    """A session that loses messages as the last ones are read."""

    def receive(self, timeout: float | None = 0.0) -> Envelope | None:
        self.lost += 7
        return None


def test_losses_and_pauses_are_told_to_the_last_one(cid: int, capsys: pytest.CaptureFixture[str]) -> None:
    service = Service()
    service.paused = 0.0625
    service.observe = lambda _: None
    with Losing(cid) as session:
        Loop("recorder", service, session, RealTimeClock(), 0).run(lambda: True)
        lost = f'{{"dodo": "lost", "messages": {session.lost}}}'
    assert capsys.readouterr().out.splitlines() == [lost, '{"dodo": "paused", "seconds": 0.062}']


PERIOD = 100_000


def test_updates_that_end_late_are_counted_from_the_begin_of_the_test() -> None:
    lateness = Lateness(PERIOD, None)
    lateness.add(0, 90_000)
    assert not lateness.late, "the test has not begun"
    lateness.begin()
    lateness.add(PERIOD, PERIOD + 50_000)
    assert not lateness.late
    lateness.add(2 * PERIOD, 2 * PERIOD + 50_001)
    assert lateness.facts() == {"updates": 2, "late": 1, "worst_s": 0.05}


def test_updates_that_were_skipped_are_late() -> None:
    lateness = Lateness(Fraction(1_000_000, 60), None)
    lateness.begin()
    lateness.add(0, 0)
    lateness.add(16_667, 16_667)
    lateness.add(1_000_000, 1_000_000)
    assert lateness.facts() == {"updates": 61, "late": 58, "worst_s": 0.0}


def test_what_a_handler_cannot_use_is_ignored_and_logged_once(cid: int, caplog: pytest.LogCaptureFixture) -> None:
    def refuse(_message: object, _time: int) -> None:
        raise UnusableMessageError("it has no attitude")

    service = Service()
    service.inputs = {("opendlv.sim.Frame", 2): refuse}
    with Session(cid) as session:
        loop = Loop("judge", service, session, RealTimeClock(), 0)
        for _ in range(2):
            loop.handle(Envelope(session.messages.id("opendlv.sim.Frame"), b"", 0, 0, 0, 2))
    assert [each.getMessage() for each in caplog.records] == [
        "ignored this and all such opendlv.sim.Frame/2: it has no attitude"
    ]
