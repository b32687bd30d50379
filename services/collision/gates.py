"""Gates: lines that the vehicle's centre has to cross in order. Metres, world frame."""

from collections.abc import Iterator, Sequence

import shapely

from services.collision.geometry import VehiclePose

Gate = tuple[str, shapely.MultiLineString]


class Gates:
    """Counts the gates crossed, in either direction and in their order; a gate out of turn does not count.

    A gate may appear more than once, for several laps.
    """

    def __init__(self, gates: Sequence[Gate]) -> None:
        self._gates = gates
        self.crossed = 0

    def __len__(self) -> int:
        return len(self._gates)

    @property
    def next(self) -> Gate | None:
        """The next gate; None when all were crossed."""
        return self._gates[self.crossed] if self.crossed < len(self) else None

    def move(self, start: VehiclePose, end: VehiclePose) -> float | None:
        """The centre moved straight from one pose to the next.

        Returns the share of this path after which all gates were crossed, None while some are left.
        """
        reached = 0.0 if self.next is None else -1.0
        while self.next is not None:
            ahead = [share for share in crossings(self.next[1], start, end) if share > reached]
            if not ahead:
                return None
            reached = min(ahead)
            self.crossed += 1
        return reached


def crossings(lines: shapely.MultiLineString, start: VehiclePose, end: VehiclePose) -> Iterator[float]:
    """The shares of the path from one pose to the next at which it crosses lines.

    Every point is on one side of a line: one that lies on it counts as left of it. So a path of several
    moves crosses a line exactly as often as its ends say, wherever the moves begin and end.
    """
    for (x1, y1), (x2, y2) in (segment for line in lines.geoms for segment in _segments(line)):
        before = (x2 - x1) * (start.y - y1) - (y2 - y1) * (start.x - x1)
        after = (x2 - x1) * (end.y - y1) - (y2 - y1) * (end.x - x1)
        if (before >= 0) != (after >= 0) and _is_left(start, end, x1, y1) != _is_left(start, end, x2, y2):
            yield before / (before - after)


def _segments(line: shapely.LineString) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    return zip(line.coords[:-1], line.coords[1:], strict=True)


def _is_left(start: VehiclePose, end: VehiclePose, x: float, y: float) -> bool:
    return (end.x - start.x) * (y - start.y) - (end.y - start.y) * (x - start.x) >= 0
