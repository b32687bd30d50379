"""The order of tests: as many at once as the machine carries, the longest first."""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass

from dodo_dsl.run.backends import Job

_RIG = 2
"""Cores for all programs of a test on a rig: an emulated one that is late spoils its test."""

Took = Callable[[Job], float | None]


def schedule(jobs: int | None, took: Took = lambda _: None) -> "Schedule":
    """A schedule of ``jobs`` at once, or of as many as there are cores for this process."""
    if jobs is not None:
        return Schedule(jobs, lambda _: 1, took)
    return Schedule(len(os.sched_getaffinity(0)), lambda job: _RIG if job.plan.rig else 1, took)


@dataclass(frozen=True)
class Schedule:
    """How many cores there are, how many each job needs, and how long it took in s, None if it never ran."""

    capacity: int
    need: Callable[[Job], int]
    took: Took = lambda _: None

    def ordered(self, jobs: Sequence[Job]) -> list[Job]:
        """The longest first, so that none of them runs alone at the end; an unknown one may take its whole timeout."""
        return sorted(jobs, key=lambda job: self.took(job) or job.plan.timeout_s, reverse=True)

    def estimate(self, jobs: Sequence[Job]) -> float | None:
        """Seconds that all cores are busy with the jobs, or that the longest one takes; None if one is unknown."""
        known = [(took, min(self.need(job), self.capacity)) for job in jobs if (took := self.took(job)) is not None]
        if len(known) < len(jobs):
            return None
        return max(sum(took * need for took, need in known) / self.capacity, *(took for took, _ in known))


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
