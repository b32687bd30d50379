import logging
from collections.abc import Callable

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from services.base.clock import RealTimeClock

SECOND = 1_000_000


class Stage(RealTimeClock):
    """A real-time clock whose time passes only where the inbox waits, and the inbox."""

    def __init__(self, coming: dict[int, int]) -> None:
        super().__init__()
        self.time = 100 * SECOND
        self.coming = {100 * SECOND + time: number for time, number in coming.items()}
        self.handled: list[tuple[int, int]] = []

    def now(self) -> int:
        return self.time

    def receive(self, timeout: float) -> Envelope | None:
        end = self.time + round(timeout * SECOND)
        for time in sorted(self.coming):
            if time <= end:
                self.time = max(self.time, time)
                return Envelope(self.coming.pop(time), b"", 0, 0, 0, 0)
        self.time = end
        return None

    def handle(self, envelope: Envelope) -> None:
        self.handled.append((self.time - 100 * SECOND, envelope.data_type))

    def run(self, period: int, count: int, work: Callable[[int], int] = lambda step: 0) -> list[int]:
        """The first instants, where an update takes `work(step)`; relative to the start."""
        steps = []
        for step, now in enumerate(self.steps(period, self, lambda: len(steps) == count)):
            steps.append(now - 100 * SECOND)
            self.time += work(step)
        return steps


def test_steps_are_the_scheduled_instants_and_messages_come_in_between() -> None:
    stage = Stage({25_000: 1, 29_000: 2, 40_000: 3})
    assert stage.run(20_000, 4) == [0, 20_000, 40_000, 60_000]
    assert stage.handled == [(25_000, 1), (29_000, 2), (40_000, 3)]


def test_a_late_service_catches_up() -> None:
    late = Stage({})
    assert late.run(20_000, 5, lambda step: 50_000 if step == 0 else 0) == [0, 20_000, 40_000, 60_000, 80_000]
    assert late.time == 100 * SECOND + 80_000


def test_a_very_late_service_skips_steps_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        steps = Stage({}).run(20_000, 4, lambda step: 1_530_000 if step == 1 else 0)
    assert steps == [0, 20_000, 1_540_000, 1_560_000]
    assert caplog.messages == ["1.5 s late, skipped 75 steps"]


def test_a_flood_does_not_hold_up_the_steps() -> None:
    stage = Stage({})
    stage.receive = lambda timeout: Envelope(1, b"", 0, 0, 0, 0)  # type: ignore[method-assign]
    assert stage.run(20_000, 1) == [0]
    assert len(stage.handled) <= 1000


def test_real_time_is_the_wall_clocks() -> None:
    clock = RealTimeClock()
    first = clock.now()
    assert first <= clock.now()
    assert first > 1_700_000_000 * SECOND
