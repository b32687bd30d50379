"""How long the clock waits for an answer of an application that gets no processor."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import pytest
from services.clock.application import ResponseTimes, SteppedApplication
from services.clock.processor_time import ApplicationProcesses, ProcessorTimes, ThreadSpent

from services.clock.exchange import ApplicationSilent, Patience

PID = 7
LIMIT_S, ANSWER_S = 0.05, 0.4


@dataclass
class Time:
    """The time module of a machine on which only waiting takes time."""

    now: float = 100.0

    def monotonic(self) -> float:
        return self.now


class Waiting(ApplicationProcesses):
    """Processes whose threads ran and waited for given shares of the time."""

    def __init__(self, time: Time, *threads: tuple[float, float]) -> None:
        super().__init__([PID])
        self._time, self._shares = time, threads

    def snapshot(self) -> ProcessorTimes:
        now = self._time.now
        threads = {str(n): ThreadSpent(ran * now, waited * now) for n, (ran, waited) in enumerate(self._shares)}
        return ProcessorTimes({PID: 0.0}, {PID: threads})


class Late:
    """Answers, and the link that brings them, after some time."""

    is_expected, missing, strangers, is_silent, flood = True, ("a.Answer",), (), False, ""

    def __init__(self, time: Time) -> None:
        self._time, self._at = time, time.now + ANSWER_S

    @property
    def is_complete(self) -> bool:
        return self._time.now > self._at

    def pump(self, timeout: float, services: object = ()) -> None:
        assert timeout > 0
        self._time.now += max(min(timeout, 0.01), 1e-6)

    def __getattr__(self, _name: str) -> Callable[..., None]:
        return lambda *_: None


SEEN, SLEEPS, COMPUTES = (0.05, 0.95), ((0.0, 0.0),), ((1.0, 0.0),)


@pytest.mark.parametrize(
    ("threads", "own", "contention", "most", "is_excused"),
    [
        pytest.param([SEEN], 0.0, 0.0, 60.0, True, id="it waits for a processor"),
        pytest.param([], 0.95, 0.0, 60.0, True, id="the clock waits for one"),
        pytest.param(
            [], 0.0, 0.95, 60.0, True, id="anything does where its processes cannot be seen, as in containers"
        ),
        pytest.param(
            [], 0.0, 0.95, 0.3, False, id="but not for ever, as a machine may be busy for as long as it is silent"
        ),
        pytest.param([], 0.0, 0.0, 60.0, False, id="nobody waits"),
        pytest.param(SLEEPS, 0.0, 0.0, 60.0, False, id="it sleeps"),
        pytest.param(COMPUTES, 0.0, 0.0, 60.0, False, id="it computes"),
        pytest.param([(0.6, 0.4), (0.0, 0.99)], 0.0, 0.0, 60.0, False, id="its pool has nothing to do"),
    ],
)
def test_what_waits_for_a_processor_does_not_count_and_what_it_takes_itself_does(
    threads: Any, own: float, contention: float, most: float, is_excused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    time = Time()
    for name, value in (
        ("time", time),
        ("own_wait_s", lambda: own * time.now),
        ("contention_s", lambda: contention * time.now),
        ("MOST_CONTENTION_S", most),
    ):
        monkeypatch.setattr(f"services.clock.application.{name}", value)
    late: Any = Late(time)
    response = cast(ResponseTimes, SimpleNamespace(add=lambda *_: None))
    application = SteppedApplication(late, Patience(LIMIT_S, LIMIT_S), late, lambda: False, response)
    application.processes = Waiting(time, *threads) if threads else ApplicationProcesses(())
    application.show((), 0)
    silent = r"did not answer frame 1 within 0\.05 s \(Answer missing\)"
    with contextlib.nullcontext() if is_excused else pytest.raises(ApplicationSilent, match=silent):
        application.await_answer()


def test_processes_that_wait_beside_one_another_win_no_time() -> None:
    times = {pid: {"0": ThreadSpent(0.5, 0.5)} for pid in range(4)}
    assert ProcessorTimes({}, times).longest_wait(ProcessorTimes({}, {})) == 0.5
