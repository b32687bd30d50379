"""How long the clock waits for an answer of an application that gets no processor."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import pytest

from services.clock.application import ResponseTimes, SteppedApplication
from services.clock.exchange import ApplicationSilent, Patience
from services.clock.processor_time import ApplicationProcesses, ProcessorTimes, ThreadSpent

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


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Time:
    time = Time()
    monkeypatch.setattr("services.clock.application.time", time)
    monkeypatch.setattr("services.clock.application.own_wait_s", lambda: 0.0)
    monkeypatch.setattr("services.clock.application.contention_s", lambda: 0.0)
    return time


def answer(time: Time, processes: ApplicationProcesses) -> None:
    late: Any = Late(time)
    response = cast(ResponseTimes, SimpleNamespace(add=lambda *_: None))
    application = SteppedApplication(late, Patience(LIMIT_S, LIMIT_S), late, lambda: False, response)
    application.processes = processes
    application.show((), 0)
    application.await_answer()


def test_what_it_waits_for_a_processor_does_not_count(time: Time) -> None:
    answer(time, Waiting(time, (0.05, 0.95)))


def test_nor_does_what_the_clock_waits(time: Time, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.clock.application.own_wait_s", lambda: 0.95 * time.now)
    answer(time, ApplicationProcesses(()))


def test_nor_does_what_anything_waits_where_its_processes_cannot_be_seen(
    time: Time, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in containers; but not for ever, as a machine may be busy for as long as the application is silent."""
    with pytest.raises(ApplicationSilent):
        answer(time, ApplicationProcesses(()))
    monkeypatch.setattr("services.clock.application.contention_s", lambda: 0.95 * time.now)
    answer(time, ApplicationProcesses(()))
    monkeypatch.setattr("services.clock.application.MOST_CONTENTION_S", 0.3)
    with pytest.raises(ApplicationSilent):
        answer(time, ApplicationProcesses(()))


@pytest.mark.parametrize(
    "threads",
    [((0.0, 0.0),), ((1.0, 0.0),), ((0.6, 0.4), (0.0, 0.99))],
    ids=["it sleeps", "it computes", "its pool has nothing to do"],
)
def test_what_it_takes_itself_counts(threads: Any, time: Time) -> None:
    with pytest.raises(ApplicationSilent, match=r"did not answer frame 1 within 0\.05 s \(Answer missing\)"):
        answer(time, Waiting(time, *threads))


def test_processes_that_wait_beside_one_another_win_no_time() -> None:
    times = {pid: {"0": ThreadSpent(0.5, 0.5)} for pid in range(4)}
    assert ProcessorTimes({}, times).longest_wait(ProcessorTimes({}, {})) == 0.5
