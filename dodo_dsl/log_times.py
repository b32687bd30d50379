"""When the parts of a service's log arrived, in a file beside it: an offset in bytes and a time in us a line.

Times are the machine's, since the epoch. A log without such a file has lines without times.
"""

import time
from array import array
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file

SUFFIX = ".times"
JUDGED_SUFFIX = ".judged"
"""Of the file beside an evaluator's log with what it judged over time."""
_MOST = 100_000
"""Parts whose times are kept."""
_STEP_US = 1000
"""Parts that come closer together are one."""
_MOST_BYTES = 8 << 20


class LogTimes:
    """Collects the times of a log that is written; 16 bytes of memory a part."""

    def __init__(self, log: Path) -> None:
        self._path = log.with_suffix(SUFFIX)
        self._offsets, self._times = array("q"), array("q")

    def note(self, offset: int) -> None:
        """From here on the log arrives now."""
        now = time.time_ns() // 1000
        if len(self._times) < _MOST and not (self._times and now - self._times[-1] < _STEP_US):
            self._offsets.append(offset)
            self._times.append(now)

    def write(self) -> None:
        """Raises OSError."""
        pairs = zip(self._offsets, self._times, strict=True)
        atomic.write_text(self._path, "".join(f"{offset} {moment}\n" for offset, moment in pairs))


def read(log: Path) -> tuple[list[int], list[int]]:
    """Offsets and times of a log, both ascending; empty if there are none that can be read."""
    offsets, times = list[int](), list[int]()
    try:
        for line in regular_file.text(log.with_suffix(SUFFIX), _MOST_BYTES).splitlines():
            offset, moment = map(int, line.split())
            if offsets and offset < offsets[-1]:
                break
            offsets.append(offset)
            times.append(moment)
    except (OSError, ValueError):
        return [], []
    return offsets, times
