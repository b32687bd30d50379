"""Measures, at short intervals while a test runs, the load of the machine and what the application's services use."""

import asyncio
import contextlib
from collections import defaultdict
from collections.abc import Awaitable, Callable, Collection, Mapping

from dodo_dsl.outcome import MachineLoad, ServiceUse, Wait
from dodo_dsl.run.machine_load.service_use import Snapshot, Used

PERIOD_S = 0.125
LAST_PATIENCE_S = 1.0
WINDOW_S = 0.4
"""The least time over which it is decided whether the machine was full."""
FULL = 0.8
"""Share of the cores from which on the machine is full: rows of ticks of 10 ms are no more precise."""
OTHERS = 0.5
"""Share of the time on processors with which others than the application take most of the machine."""


class Meter:
    """Looks by ``take`` from ``begin`` to ``end``, at times ``test_s`` of the test.

    ``is_application`` says which services are the application's.
    """

    def __init__(
        self,
        take: Callable[[], Awaitable[Snapshot | None]],
        test_s: Callable[[], float],
        is_application: Callable[[str], bool],
    ) -> None:
        self._take = take
        self._test_s = test_s
        self._is_application = is_application
        self._times: list[float] = []
        """Those of the test at the first and the last look."""
        self._task: asyncio.Task[None] | None = None
        self._first: Snapshot | None = None
        self._window: Snapshot | None = None
        """The first of those that are not judged yet."""
        self._last: Snapshot | None = None
        self._used: dict[str, Used] = {}
        """Of each service, with the most memory that it used."""
        self._crowded_s = 0.0
        self._displaced_s = defaultdict[str, float](float)

    def begin(self) -> None:
        self._task = asyncio.ensure_future(self._run())

    async def end(self) -> None:
        """Looks for the last time, with little patience."""
        if self._task is None:
            return
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        self._task = None
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LAST_PATIENCE_S):
                await self._look()

    async def _run(self) -> None:
        while True:
            await self._look()
            await asyncio.sleep(PERIOD_S)

    async def _look(self) -> None:
        if (snapshot := await self._take()) is not None:
            self.add(snapshot)

    def add(self, snapshot: Snapshot) -> None:
        """What services have used up to a time."""
        self._times = [*self._times[:1], self._test_s()]
        for name, used in snapshot.services.items():
            self._used[name] = used._replace(memory=max(used.memory, self._used.get(name, used).memory))
        self._first, self._last = self._first or snapshot, snapshot
        self._window = self._window or snapshot
        if snapshot.at_s - self._window.at_s >= WINDOW_S:
            self._judge(self._window, snapshot)

    def _judge(self, before: Snapshot, after: Snapshot) -> None:
        """Adds up for how long others than the application filled the machine, and what services waited meanwhile.

        Nothing is put down to others that was so while the machine had free cores, or while the application itself took
        most of them.
        """
        self._window = after
        if before.busy_s is None or after.busy_s is None:
            return
        took_s, busy_s = after.at_s - before.at_s, after.busy_s - before.busy_s
        spent = {name: _since(before, name, used) for name, used in after.services.items()}
        own_s = sum(ran_s for name, (ran_s, _) in spent.items() if self._is_application(name))
        if took_s > 0 and busy_s >= FULL * after.cores * took_s and busy_s - own_s >= OTHERS * busy_s:
            self._crowded_s += took_s
            for name, (_, waited_s) in spent.items():
                self._displaced_s[name] += waited_s

    def load(self) -> MachineLoad | None:
        """The load between the first and the last snapshot; None if it was not measured."""
        first, last = self._first, self._last
        if first is None or last is None or last.at_s <= first.at_s or first.busy_s is None or last.busy_s is None:
            return None
        if self._window and self._window.at_s < last.at_s:
            self._judge(self._window, last)
        took_s = last.at_s - first.at_s
        spent = {name: _since(first, name, used) for name, used in self._used.items()}
        application, services = (
            self._longest({n: each for n, each in spent.items() if self._is_application(n) == kind}, took_s)
            for kind in (True, False)
        )
        others_s = max(last.busy_s - first.busy_s - sum(ran for ran, _ in spent.values()), 0.0)
        return MachineLoad(took_s, last.cores, application, services, others_s / (last.cores * took_s), self._crowded_s)

    def _longest(self, spent: Mapping[str, tuple[float, float]], took_s: float) -> Wait:
        """What some services ran together, and the wait of the one of them that others kept waiting the longest.

        The kernel counts a wait when it is over, so those of several threads can overlap; none is longer than the test.
        """
        name = max(spent, key=lambda n: (self._displaced_s[n], spent[n][1]), default="")
        waited_s = min(spent.get(name, (0.0, 0.0))[1], took_s)
        return Wait(sum(ran for ran, _ in spent.values()), waited_s, min(self._displaced_s[name], took_s), name)

    def figures(self, names: Collection[str]) -> tuple[ServiceUse, ...]:
        passed_s, found = self._times[-1] - self._times[0] if self._times else 0.0, []
        for name in sorted({*names} & self._used.keys()):
            ran_s, _ = _since(self._first, name, self._used[name])
            share = ran_s / passed_s if passed_s > 0 else None
            found.append(ServiceUse(name, ran_s, share, self._used[name].memory))
        return tuple(found)


def _since(before: Snapshot | None, name: str, now: Used) -> tuple[float, float]:
    """What a service ran and waited since a snapshot."""
    then = before.services.get(name, Used()) if before else now
    return max(now.processor_s - then.processor_s, 0.0), max(now.waited_s - then.waited_s, 0.0)
