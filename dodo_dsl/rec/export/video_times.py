"""When the frames of a video are shown."""

from collections.abc import Iterator
from dataclasses import dataclass

from dodo_dsl.opendlv.messages.varints import Numbers

MOST_GAP = 1_800_000_000
"""us between two frames; an MP4 counts the time of a frame in 32 bits."""
DEFAULT_LASTING = 100_000
"""us that a single frame is shown."""


@dataclass
class VideoTimes:
    """When frames are shown, in us since the first, which was taken at ``begin``.

    Each is at least 1 us and at most MOST_GAP after the one before; ``late`` of them are so, and ``gaps`` shortened.
    """

    begin: int = 0
    late: int = 0
    gaps: int = 0
    _last: int | None = None
    _shown: int = 0

    def shown(self, time: int) -> int:
        """When the next frame is shown, which was taken at ``time``."""
        if self._last is None:
            self.begin = self._last = time
        else:
            rising = max(time, self._last + 1)
            self.late += rising != time
            self.gaps += rising - self._last > MOST_GAP
            self._shown += min(rising - self._last, MOST_GAP)
            self._last = rising
        return self._shown


def timed(
    found: Iterator[tuple[int, bytes]], taken: Numbers, times: VideoTimes
) -> Iterator[tuple[int, bytes, int, int]]:
    """Number, packet, when it is shown and for how long, in us; the last as long as the one before."""
    waiting, lasting = None, DEFAULT_LASTING
    for number, data in found:
        shown = times.shown(int(taken[number]))
        if waiting is not None:
            lasting = shown - waiting[2]
            yield *waiting, lasting
        waiting = number, data, shown
    if waiting is not None:
        yield *waiting, lasting
