"""A clock whose steps come as messages fits without a change to a service."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.session import Session
from services.base import Context, Inbox, RealTimeClock, Service, run

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


def test_a_clock_driven_by_messages(
    cid: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DODO_READY_FILE", str(tmp_path / "ready"))
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
    assert capsys.readouterr().out == '{"dodo": "ready"}\n'


def _step(time: int) -> Any:
    from dodo_dsl.opendlv.envelope import Envelope

    return Envelope(STEP, b"", 0, 0, time, 0)
