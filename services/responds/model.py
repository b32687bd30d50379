"""The frames of a recording or of a camera, and which of them an answer is to."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.recording import Recording

Times = NDArray[np.int64]
"""Microseconds."""
_SAME = 1_500
"""Microseconds by which the sample time of an answer may differ from that of its frame: what rounding does."""


@dataclass(frozen=True)
class Frames:
    """The frames of a test, ascending: when each is ``due``, in us from its start, and its sample time in ``stamps``.

    Without ``stamps`` these are times of the test.
    """

    due: Times
    stamps: Times | None = None

    def of(self, sample_time: int, arrival: int, begin: int) -> int:
        """The number of the frame that is answered, -1 for none, by the sample time of an answer and its arrival in us.

        One that has not the sample time of a frame answers the last that was due when it arrived.
        """
        stamps, sought = (self.due, sample_time - begin) if self.stamps is None else (self.stamps, sample_time)
        number = int(np.searchsorted(stamps, sought + _SAME, side="right")) - 1
        if number >= 0 and sought - stamps[number] <= _SAME:
            return number
        return int(np.searchsorted(self.due, arrival - begin, side="right")) - 1


def at_rate(freq: float, seconds: float) -> Frames:
    """The frames of a camera of ``freq`` Hz in so many seconds."""
    return Frames(np.rint(np.arange(int(freq * seconds) + 1) * (MICROSECONDS / freq)).astype(np.int64))


def of_recording(
    path: Path,
    sender: int,
    start: float,
    end: float | None,
    max_gap: float,
    timemod: float,
    is_test_time: bool = False,
) -> Frames:
    """The pictures of ``sender`` as the player shows them, from ``start`` to ``end`` s; raises ValueError if none is.

    Gaps are at most ``max_gap`` s, and then all goes ``timemod`` times faster. ``is_test_time``: pictures carry the
    time of the test.
    """
    with Recording(path) as recording:
        rows, times, due = recording_times.played(recording, start, end, round(max_gap * MICROSECONDS), timemod)
        shown = np.isin(rows, recording.rows([IMAGE], sender_stamps=[sender]))
    if not shown.any():
        raise ValueError(f"{path}: has no pictures of sender {sender} in the part that is played")
    return Frames(due[shown], None if is_test_time else times[shown])
