"""What the application's services use in the course of a test: processor time, memory, and how that grows."""

import bisect
import itertools
import statistics
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from dodo_dsl.outcome import ServiceUse
from dodo_dsl.run.load.meter import Meter
from dodo_dsl.run.load.service_use import Used

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
    """The time that a test had reached, between those that are known; 0 where none is."""
    after = bisect.bisect_right(progress, at_s, key=lambda pair: pair[0])
    if after in (0, len(progress)):
        return progress[after - 1 if after else 0][1] if progress else 0.0
    (begin_s, before), (end_s, behind) = progress[after - 1 : after + 1]
    return before + (behind - before) * (at_s - begin_s) / (end_s - begin_s)


def growth(points: Sequence[Point], known: Collection[float] | None = None) -> float | None:
    """Bytes a second by which memory grows in the second half of the time, in which programs have warmed up.

    It is the median slope of all pairs of points (Theil and Sen), as single points may be anywhere. 0 where memory does
    not rise by LEAST_RISE, or not in each half of this half. None where there are too few points to tell,
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
