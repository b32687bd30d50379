"""Pauses of the clock, in which a program with timers goes on and one that waits for frames does not."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st
from services.clock.application import ResponseTimes, SteppedApplication

from dodo_dsl.opendlv.envelope import Envelope
from services.clock.answers import Answers, MessageFilter
from services.clock.exchange import Patience

STEER = MessageFilter("steer", 1090)
STEP_S, FRAMES = 0.03, 30


@dataclass
class Bus:
    """A link on which messages come at certain times of its own clock, in s, which is the time module as well."""

    coming: list[float]
    answers: Answers
    now: float = 100.0

    def monotonic(self) -> float:
        return self.now

    def pump(self, timeout: float, services: object = ()) -> None:
        self.now += max(min(timeout, min([*self.coming[:1], self.now + 0.05]) - self.now), 1e-6)
        self.drain()

    def drain(self) -> None:
        while self.coming and self.coming[0] <= self.now:
            self.coming.pop(0)
            self.answers.take(Envelope(STEER.data_type, b"", 0, 0, 0, 0))

    def __getattr__(self, _name: str) -> Callable[..., None]:
        return lambda *_: None


def driven(period_s: float | None = None, after: tuple[float, ...] = (0.004,)) -> dict[str, Any]:
    """What is reported of an application that sends each period, or so many s after it was shown a frame."""
    answers = Answers((STEER,))
    ticks = [100.0 + n * period_s for n in range(1, round(20 / period_s))] if period_s else []
    bus: Any = Bus(ticks, answers)
    with mock.patch("services.clock.application.time", bus):
        application = SteppedApplication(answers, Patience(5.0, 5.0), bus, lambda: False, ResponseTimes())
        for frame in range(FRAMES):
            application.pause()
            bus.now += STEP_S
            bus.drain()
            answers.expect([frame + 1])
            answers.seen()
            bus.coming.extend(bus.now + each for each in after if not period_s)
            application.show((), frame)
            application.await_answer()
            application.collect()
    return application.facts()


@given(st.floats(0.002, 0.4))
def test_a_timer_is_seen_in_each_pause(period_s: float) -> None:
    facts = driven(period_s)
    assert facts["unasked"] == facts["pauses"] == 2


@pytest.mark.parametrize("after", [(0.004,), (0.3,), (0.004, 0.005, 0.006), (0.004, 0.03), (0.004, 0.055)])
def test_who_waits_for_frames_is_not_taken_for_one_with_timers(after: tuple[float, ...]) -> None:
    """Nor is one whose answers come twice, or late."""
    facts = driven(after=after)
    assert (facts["pauses"], facts["unasked"]) == (2, 0)
    assert (facts["surplus"] > 0) is (len(after) > 1)


def test_without_a_further_answer_nothing_is_reported() -> None:
    answers = Answers((STEER,))
    bus: Any = Bus([], answers)
    assert SteppedApplication(answers, Patience(5.0, 5.0), bus, lambda: False, ResponseTimes()).facts() == {}
