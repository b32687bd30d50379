"""The order of tests: as many at once as the machine carries, the longest first."""

import asyncio
import contextlib
import heapq
import math
import os
from collections import deque
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Job

_EPSILON = 1e-9
_BASE, _PIXELS_PER_CORE = 0.25, 7_500_000.0
"""Cores for a test without pictures, and pixels a second that a core renders, shares and analyses."""
_MARGIN, _LEAST = 1.5, 0.1
"""Cores a test gets for each that it used on average: two thirds busy, a machine lets hardly anything wait."""
_SETUP = 1.0
"""Cores that set-up takes: programs load their libraries one after the other."""
_RIG = 2.0
"""Cores for all programs of a test on a rig."""


def cores_needed(plan: Plan, used: float | None = None) -> float:
    """The cores that keep a test in real time; one in lockstep, which runs at full speed.

    They are what earlier runs of it ``used`` with a margin, because it needs them in bursts, else by the size of its
    pictures. A rig gets more: an emulated one that is late spoils its test.
    """
    if plan.rig:
        return _RIG
    if plan.clock != "realtime":
        return 1.0
    if used is not None:
        return max(round(_MARGIN * used, 2), _LEAST)
    return round(_BASE + sum(_pixels_a_second(plan)) / _PIXELS_PER_CORE, 2)


def _pixels_a_second(plan: Plan) -> list[float]:
    rates = []
    for service in plan.services:
        flags = {flag.name: flag.value for flag in service.flags}
        with contextlib.suppress(KeyError, ValueError):
            rates.append(float(flags["width"]) * float(flags["height"]) * float(flags["freq"]))
    return [rate for rate in rates if math.isfinite(rate)]


def schedule(
    jobs: int | None, expected: Callable[[Job], float], used: Callable[[Job], float | None] = lambda _: None
) -> "Schedule":
    """A schedule of ``jobs`` at once, or of as many as this process's cores carry; ``used`` by earlier runs."""
    if jobs is not None:
        return Schedule(jobs, lambda job: 1.0, expected)
    cores = len(os.sched_getaffinity(0))
    return Schedule(cores, lambda job: cores_needed(job.plan, used(job)), expected, min(_SETUP, cores))


@dataclass(frozen=True)
class Schedule:
    """How many cores there are, how many each job needs, and how long it is expected to take in s.

    The forecast leaves out that set-up may need more cores than the test.
    """

    capacity: float
    need: Callable[[Job], float]
    expected: Callable[[Job], float]
    setup: float = 0.0
    """Cores that a test takes at least until it begins, so that its set-up does not disturb those that run."""

    def ordered(self, jobs: Sequence[Job]) -> list[Job]:
        """The longest first, so that none of them runs alone at the end."""
        return sorted(jobs, key=self.expected, reverse=True)

    def forecast(self, jobs: Sequence[Job], running: Sequence[tuple[Job, float]] = ()) -> float:
        """Seconds until the last of ``jobs`` has ended; ``running`` are jobs with the seconds that they ran already."""
        now, free = 0.0, self.capacity
        ends: list[tuple[float, int, float]] = []
        begun = [(job, max(self.expected(job) - elapsed, 0.0)) for job, elapsed in running]
        for number, (job, left) in enumerate([*begun, *((job, self.expected(job)) for job in jobs)]):
            need = min(self.need(job), self.capacity)
            while ends and free < need - _EPSILON and number >= len(begun):
                now, _, given = heapq.heappop(ends)
                free += given
            free -= need
            heapq.heappush(ends, (now + left, number, need))
        return max((end for end, _, _ in ends), default=0.0)


class Share:
    """The cores that a test holds, until it gives them back to the pool."""

    def __init__(self, cores: float, give: Callable[[float], None]) -> None:
        self._cores, self._give = cores, give

    def shrink(self, cores: float) -> None:
        """Keeps no more than ``cores``."""
        surplus = max(self._cores - cores, 0.0)
        self._cores -= surplus
        self._give(surplus)


class CorePool:
    """Cores that tests take and give back, first come, first served."""

    def __init__(self, capacity: float) -> None:
        self._capacity = self._free = capacity
        self._waiting: deque[tuple[float, asyncio.Future[None]]] = deque()

    @contextlib.asynccontextmanager
    async def take(self, need: float) -> AsyncIterator[Share]:
        """Waits until ``need`` cores are free; a test that needs more than there are takes all."""
        need = min(need, self._capacity)
        turn = asyncio.get_running_loop().create_future()
        self._waiting.append((need, turn))
        self._serve()
        try:
            await turn
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled():
                self._give(need)
            raise
        share = Share(need, self._give)
        try:
            yield share
        finally:
            share.shrink(0.0)

    def _give(self, need: float) -> None:
        self._free += need
        self._serve()

    def _serve(self) -> None:
        while self._waiting and (self._waiting[0][1].done() or self._waiting[0][0] <= self._free + _EPSILON):
            need, turn = self._waiting.popleft()
            if not turn.done():
                self._free -= need
                turn.set_result(None)
