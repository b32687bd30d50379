"""A clock whose steps come as messages fits without a change to a service."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.session import Session
from services.base import Context, Inbox, RealTimeClock, Service, period_of, run
from services.base.lockstep_clock import EPOCH, LONGEST, in_order

STEP = 2950
MANIFEST = "{name: stepped, process: [stepped], description: Steps.}"


class SteppedClock(RealTimeClock):
    """Test time is the sample time of the last step message; services see no message of this kind."""

    def __init__(self) -> None:
        self.time = 0

    def now(self) -> int:
        return self.time

    def steps(self, period: int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        while not stopped():
            envelope = inbox.receive(10.0)
            assert envelope is not None
            if envelope.data_type != STEP:
                inbox.handle(envelope)
                continue
            self.time = envelope.sample_time
            yield self.time


class Counting(Service):
    def __init__(self, context: Context, seen: list[int]) -> None:
        self.seen = seen
        self.inputs = {("opendlv.proxy.DistanceReading", None): lambda message, time: seen.append(-time)}

    def update(self, now: int) -> Iterable[Any]:
        self.seen.append(now)
        self.finished = now == 3
        return ()


def test_messages_are_due_by_test_time_and_others_behind_what_came_before_them() -> None:
    """The test's begin stays first, however old a recording is whose own times are kept."""
    old, new = EPOCH - 7_000_000, EPOCH + LONGEST + 1
    times = (EPOCH, old, EPOCH + 20, new, EPOCH + 10)
    heard = in_order(Envelope(1, str(number).encode(), 0, 0, time, 0) for number, time in enumerate(times))
    assert [(due - EPOCH, envelope.payload) for due, envelope in heard] == [
        (0, b"0"), (0, b"1"), (10, b"4"), (20, b"2"), (20, b"3"),
    ]  # fmt: skip


@pytest.mark.parametrize(("slow", "fast"), [(30.0, 60.0), (15.0, 60.0), (12.0, 24.0), (29.97, 59.94), (0.3, 0.9)])
def test_multiples_of_a_rate_meet_for_ever(slow: float, fast: float) -> None:
    one, other = period_of(slow), period_of(fast)
    times = round(fast / slow)
    assert all(round(n * one) == round(n * times * other) for n in range(0, 100_000, 7))


def test_a_clock_driven_by_messages(
    cid: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "service.yml").write_text(MANIFEST)
    seen: list[int] = []
    with Session(cid) as session:
        distance = session.messages.type("opendlv.proxy.DistanceReading")

        def build(context: Context) -> Service:
            for time in (1, 2, 3):
                session.send(distance(), sample_time=time * 10)
                session.send_envelope(_step(time))
            return Counting(context, seen)

        assert run(tmp_path, build, [f"--cid={cid}"], SteppedClock()) == 0
        end = session.receive(10.0)
    assert seen == [-10, 1, -20, 2, -30, 3]
    assert end is not None and (end.data_type, end.sample_time) == (2901, 3)
    assert capsys.readouterr().out == '{"dodo": "ready"}\n{"dodo": "end-of-input"}\n'


def _step(time: int) -> Any:
    from dodo_dsl.opendlv.envelope import Envelope

    return Envelope(STEP, b"", 0, 0, time, 0)
