"""Measures the load of the machine and the use of the application's services while a test runs, at short intervals.

Snapshots add up to the load. Use is processor time, memory, and how that grows.
"""

import asyncio
import bisect
import contextlib
import itertools
import statistics
from collections import defaultdict
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from dodo_dsl.outcome import MachineLoad, ServiceUse, Wait
from dodo_dsl.run.machine_load.service_use import Used
from dodo_dsl.run.machine_load.snapshot import Snapshot, Times

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

    ``application`` names the application's services. Nothing is put down to others that was so while the
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


FIRST_PERIOD_S, MOST_PERIOD_S = 0.02, 0.25
"""A test of 30 frames in lockstep may be over in a second, and a long one needs no more than a few looks a second."""
_PERIOD_SHARE = 0.02
"""Of the time that passed so far, until the next look."""
LEAST_RISE = 1_000_000
"""Bytes by which memory has to rise for a growth: less is what programs take and give back at any time."""
_LEAST_SHARE = 1 / 6
"""Of the rise that each half of it has to have: memory that is taken once, whenever that is, does not grow."""
_LEAST_POINTS, _MOST_POINTS = 3, 60
_LEAST_TIMES = 8
"""Known times of the test within the second half: what was measured between two of them may be of either."""
_MOST_KEPT = 2000

Point = tuple[float, float]
"""Time in s and bytes of memory."""


def period_s(passed_s: float) -> float:
    """Seconds until the next look."""
    return min(max(FIRST_PERIOD_S, _PERIOD_SHARE * passed_s), MOST_PERIOD_S)


@dataclass
class _Service:
    first_processor_s: float
    last: Used
    peak: int = 0
    points: list[Point] = field(default_factory=list)


class UseMeter(Meter):
    """Looks by ``take``, which gives what each service of the application used so far, at times of ``clock``, in s."""

    def __init__(self, take: Callable[[], Awaitable[Mapping[str, Used] | None]], clock: Callable[[], float]) -> None:
        super().__init__(self._add_taken, period_s)
        self._take = take
        self._clock = clock
        self._times: list[float] = []
        self._services: dict[str, _Service] = {}

    async def _add_taken(self) -> None:
        found = await self._take()
        if found is not None:
            self.add(self._clock(), found)

    def add(self, at_s: float, found: Mapping[str, Used]) -> None:
        """What services have used up to a time."""
        self._times = [*self._times[:1], at_s]
        for name, used in found.items():
            service = self._services.setdefault(name, _Service(used.processor_s, used))
            service.last = used
            service.peak = max(service.peak, used.memory)
            if used.memory:
                service.points.append((at_s, used.memory))
            if len(service.points) > _MOST_KEPT:
                del service.points[1:-1:2]

    def figures(self, progress: Sequence[tuple[float, float]], in_steps: bool = False) -> tuple[ServiceUse, ...]:
        """What each service used; ``progress`` are times of the clock with those of the test, in ascending order.

        ``in_steps``: between these the test may have stood still, as in lockstep.
        """
        if not self._times:
            return ()
        passed_s = test_time(progress, self._times[-1]) - test_time(progress, self._times[0])
        known = {at_s for _, at_s in progress} if in_steps else None
        return tuple(_figures(name, self._services[name], progress, passed_s, known) for name in sorted(self._services))


def _figures(
    name: str,
    service: _Service,
    progress: Sequence[tuple[float, float]],
    passed_s: float,
    known: Collection[float] | None,
) -> ServiceUse:
    points = [(test_time(progress, at_s), size) for at_s, size in service.points]
    ran_s = service.last.processor_s - service.first_processor_s
    return ServiceUse(
        service=name,
        processor_s=ran_s,
        processor_share=ran_s / passed_s if passed_s > 0 else None,
        peak_memory_bytes=service.peak,
        memory_growth_bytes_per_s=growth(points, known),
        memory_limit_bytes=service.last.limit or None,
    )


def test_time(progress: Sequence[tuple[float, float]], at_s: float) -> float:
    """The time that a test had reached, between those that are known; 0 if none is."""
    after = bisect.bisect_right(progress, at_s, key=lambda pair: pair[0])
    if after in (0, len(progress)):
        return progress[after - 1 if after else 0][1] if progress else 0.0
    (begin_s, before), (end_s, behind) = progress[after - 1 : after + 1]
    return before + (behind - before) * (at_s - begin_s) / (end_s - begin_s)


def growth(points: Sequence[Point], known: Collection[float] | None = None) -> float | None:
    """Bytes a second by which memory grows in the second half of the time, in which programs have warmed up.

    It is the median slope of all pairs of points (Theil and Sen), as single points may be anywhere. 0 where memory does
    not rise by LEAST_RISE, or not in each half of this half. None if there are too few points,
    or too few times that are ``known``: without these all are.
    """
    found = _second_half(points)
    if len(found) < _LEAST_POINTS:
        return None
    if known is not None and sum(found[0][0] <= at_s <= found[-1][0] for at_s in known) < _LEAST_TIMES:
        return None
    slopes = [(b - a) / (end - begin) for (begin, a), (end, b) in itertools.combinations(found, 2)]
    slope, rise = statistics.median(slopes), statistics.median(slopes) * (found[-1][0] - found[0][0])
    third = max(len(found) // 3, 1)
    sizes = [size for _, size in found]
    low, high = statistics.median(sizes[:third]), statistics.median(sizes[-third:])
    central = sizes[third:-third]
    rises = statistics.median_low(central) - low, high - statistics.median_high(central)
    return slope if rise >= LEAST_RISE and min(rises) >= _LEAST_SHARE * rise else 0.0


def _second_half(points: Sequence[Point]) -> list[Point]:
    """The last point of each of _MOST_POINTS parts of the time: where a test stands still, many are of one time."""
    if not points or points[-1][0] <= points[0][0]:
        return []
    middle_s, end_s = (points[0][0] + points[-1][0]) / 2, points[-1][0]
    parts = {
        int(_MOST_POINTS * (at_s - middle_s) / (end_s - middle_s)): (at_s, size)
        for at_s, size in points
        if at_s >= middle_s
    }
    return list(parts.values())
