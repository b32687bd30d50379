"""The order of tests: as many at once as the machine carries, the longest first."""

import asyncio
import contextlib
import heapq
import os
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass

from dodo_dsl.run.backends import Job

_RIG = 2
"""Cores for all programs of a test on a rig: an emulated one that is late spoils its test."""


def schedule(jobs: int | None, expected: Callable[[Job], float]) -> "Schedule":
    """A schedule of ``jobs`` at once, or of as many as there are cores for this process."""
    if jobs is not None:
        return Schedule(jobs, lambda _: 1, expected)
    return Schedule(len(os.sched_getaffinity(0)), lambda job: _RIG if job.plan.rig else 1, expected)


@dataclass(frozen=True)
class Schedule:
    """How many cores there are, how many each job needs, and how long it is expected to take in s."""

    capacity: int
    need: Callable[[Job], int]
    expected: Callable[[Job], float]

    def ordered(self, jobs: Sequence[Job]) -> list[Job]:
        """The longest first, so that none of them runs alone at the end."""
        return sorted(jobs, key=self.expected, reverse=True)

    def forecast(self, jobs: Sequence[Job], running: Sequence[tuple[Job, float]] = ()) -> float:
        """Seconds until the last of ``jobs`` has ended; ``running`` are jobs with the seconds that they ran already."""
        now, free = 0.0, self.capacity
        ends: list[tuple[float, int, int]] = []
        begun = [(job, max(self.expected(job) - elapsed, 0.0)) for job, elapsed in running]
        for number, (job, left) in enumerate([*begun, *((job, self.expected(job)) for job in jobs)]):
            need = min(self.need(job), self.capacity)
            while ends and free < need and number >= len(begun):
                now, _, given = heapq.heappop(ends)
                free += given
            free -= need
            heapq.heappush(ends, (now + left, number, need))
        return max((end for end, _, _ in ends), default=0.0)


class CorePool:
    """Cores that tests take and give back, first come, first served."""

    def __init__(self, capacity: int) -> None:
        self._capacity, self._free, self._turn = capacity, asyncio.Semaphore(capacity), asyncio.Lock()

    @contextlib.asynccontextmanager
    async def take(self, need: int) -> AsyncIterator[None]:
        """Waits until ``need`` cores are free; a test that needs more than there are takes all."""
        with contextlib.ExitStack() as taken:
            async with self._turn:
                for _ in range(min(need, self._capacity)):
                    await self._free.acquire()
                    taken.callback(self._free.release)
            yield
