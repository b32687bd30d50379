"""Measures the load of the machine while a test runs: snapshots at short intervals, and what they add up to."""

import asyncio
import contextlib
import itertools
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping, Sequence

from dodo_dsl.outcome import MachineLoad, Wait
from dodo_dsl.run.load.snapshot import Snapshot, Times

PERIOD_S = 0.4
LAST_PATIENCE_S = 1.0
FULL = 0.8
"""Share of the cores from which on the machine is full: rows of ticks of 10 ms are no more precise."""
OTHERS = 0.5
"""Share of the time on processors with which others than the application take most of the machine."""
_NONE = Times(0.0, 0.0)


class Meter:
    """Calls ``look`` from ``begin`` to ``end``; ``period`` gives the seconds to the next time by those that passed."""

    def __init__(self, look: Callable[[], Awaitable[None]], period: Callable[[float], float]) -> None:
        self._look = look
        self._period = period
        self._task: asyncio.Task[None] | None = None
        self._is_over = False

    def begin(self) -> None:
        self._task = asyncio.ensure_future(self._run())

    async def end(self) -> None:
        """Looks for the last time, with little patience."""
        if self._task is None:
            return
        self._is_over = True  # also for a snapshot that came as it was cancelled
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        self._task = None
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LAST_PATIENCE_S):
                await self._look()

    async def _run(self) -> None:
        now = asyncio.get_running_loop().time
        began = now()
        while not self._is_over:
            await self._look()
            await asyncio.sleep(self._period(now() - began))


class LoadMeter(Meter):
    """Takes snapshots by ``take``; threads that live for less than PERIOD_S may be missed."""

    def __init__(self, take: Callable[[], Awaitable[Snapshot | None]]) -> None:
        super().__init__(self._add, lambda _: PERIOD_S)
        self._take = take
        self.snapshots: list[Snapshot] = []

    async def _add(self) -> None:
        snapshot = await self._take()
        if snapshot is not None:
            self.snapshots.append(snapshot)


def add_up(snapshots: Sequence[Snapshot], application: Callable[[str], bool]) -> MachineLoad | None:
    """The load between the first and the last snapshot; None when there are no two of them.

    ``application`` tells which services are the application's. Nothing is put down to others that was so while the
    machine had free cores, or while the application itself took most of them.
    """
    if len(snapshots) < 2 or snapshots[-1].at_s <= snapshots[0].at_s:
        return None
    displaced: dict[str, float] = defaultdict(float)
    crowded_s = 0.0
    for before, after in itertools.pairwise(snapshots):
        if _is_crowded(before, after, application):
            crowded_s += after.at_s - before.at_s
            for name, times in _spent(before, after).items():
                displaced[name] += times.waited_s
    first, last = snapshots[0], snapshots[-1]
    spent, took_s = _spent(first, last), last.at_s - first.at_s
    own_s = sum(times.ran_s for times in spent.values())
    return MachineLoad(
        duration_s=took_s,
        cores=last.cores,
        application=_longest({n: t for n, t in spent.items() if application(n)}, displaced, took_s),
        services=_longest({n: t for n, t in spent.items() if not application(n)}, displaced, took_s),
        others_share=max(last.busy_s - first.busy_s - own_s, 0.0) / (last.cores * took_s),
        crowded_s=crowded_s,
    )


def _spent(before: Snapshot, after: Snapshot) -> dict[str, Times]:
    """What each service ran and waited between two snapshots."""
    found = {}
    for name, now in after.services.items():
        then = before.services.get(name, _NONE)
        found[name] = Times(max(now.ran_s - then.ran_s, 0.0), max(now.waited_s - then.waited_s, 0.0))
    return found


def _is_crowded(before: Snapshot, after: Snapshot, application: Callable[[str], bool]) -> bool:
    """Whether the machine was full between two snapshots, and others than the application took most of it.

    Not where it may have been the application by processes that came and went, and that nobody counts.
    """
    if before.changes != after.changes:
        return False
    available_s, busy_s = after.cores * (after.at_s - before.at_s), after.busy_s - before.busy_s
    own_s = sum(times.ran_s for name, times in _spent(before, after).items() if application(name))
    return available_s > 0 and busy_s >= FULL * available_s and busy_s - own_s >= OTHERS * busy_s


def _longest(spent: Mapping[str, Times], displaced: Mapping[str, float], took_s: float) -> Wait:
    """What some services ran together, and the wait of the one of them that others kept waiting the longest.

    The kernel counts a wait when it is over, so those of several threads can overlap; none is longer than the test.
    """
    name = max(spent, key=lambda n: (displaced.get(n, 0.0), spent[n].waited_s), default="")
    return Wait(
        ran_s=sum(times.ran_s for times in spent.values()),
        waited_s=min(spent.get(name, _NONE).waited_s, took_s),
        displaced_s=min(displaced.get(name, 0.0), took_s),
        longest=name,
    )
