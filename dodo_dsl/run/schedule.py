"""The order of tests: as many at once as the machine carries, the longest first."""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Callable, Sequence

from dodo_dsl.run.backends import Job

_RIG = 2
"""Cores for all programs of a test on a rig: an emulated one that is late spoils its test."""

Took = Callable[[Job], float | None]


class Schedule:
    """So many ``jobs`` at once, or as many as there are cores; ``took`` says how long one took in s, if known."""

    def __init__(self, jobs: int | None, took: Took = lambda _: None) -> None:
        self.capacity, self._took = len(os.sched_getaffinity(0)) if jobs is None else jobs, took
        self._on_rig = _RIG if jobs is None else 1
        self._free, self._turn = asyncio.Semaphore(self.capacity), asyncio.Lock()

    def need(self, job: Job) -> int:
        """How many of them a job takes."""
        return self._on_rig if job.plan.rig else 1

    def ordered(self, jobs: Sequence[Job]) -> list[Job]:
        """The longest first, so that none of them runs alone at the end; an unknown one may take its whole timeout."""
        return sorted(jobs, key=lambda job: self._took(job) or job.plan.timeout_s, reverse=True)

    @contextlib.asynccontextmanager
    async def take(self, need: int) -> AsyncIterator[None]:
        """Waits until ``need`` cores are free, first come, first served; who needs more than there are takes all."""
        with contextlib.ExitStack() as taken:
            async with self._turn:
                for _ in range(min(need, self.capacity)):
                    await self._free.acquire()
                    taken.callback(self._free.release)
            yield
