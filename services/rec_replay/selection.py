"""The part of a recording to play (a span of time, some messages, one camera's pictures), and where its player is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.message_columns import Marks, Numbers
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording, matching


@dataclass(frozen=True)
class Part:
    """Rows of a recording in the order in which they are played: when (microseconds from the start), and how.

    `shown` marks the pictures for the memory, `sent` the messages for the bus; each row is one of them.
    """

    rows: Numbers
    due: Numbers
    sent: Marks
    shown: Marks

    def __len__(self) -> int:
        return len(self.rows)


def select(
    recording: Recording,
    known: MessageSet,
    max_gap: int,
    *,
    start: float = 0.0,
    end: float | None = None,
    timemod: float = 1.0,
    messages: Sequence[str] = (),
    without: Sequence[str] = (),
    camera: int | None = 0,
) -> Part:
    """The part that is played, as ``recording_times.played`` has it; raises ValueError.

    ``messages`` (all if empty) and ``without`` name messages on the bus, ``camera`` is the sender of pictures (None for
    none). DoDo's own messages of an earlier test are never sent.
    """
    stretch, _, due = recording_times.played(recording, start, end, max_gap, timemod)
    if fault := recording_times.fault(recording, np.sort(stretch)):
        raise ValueError(f"{recording.path} cannot be played: {fault}")
    index = recording.index[stretch]
    images = index["data_type"] == IMAGE
    sent = ~images & ~matching(index, map(known.key, without))
    if messages:
        sent &= matching(index, map(known.key, messages))
    shown = images & (index["sender_stamp"] == camera)
    chosen = np.flatnonzero(sent | shown)
    if not len(chosen):
        raise ValueError(f"{recording.path} has no message in the selected part")
    return Part(stretch[chosen], due[chosen], sent[chosen], shown[chosen])


class Player:
    """Computes which entries are due. ``due`` holds the time of each in microseconds from the start, ascending.

    Nothing is due until it is `playing`. With `rewinds` it begins again at its end, in a new `round`.
    """

    def __init__(self, due: Numbers, rewinds: bool = False) -> None:
        self.position = self.round = 0
        self.playing = False
        self.rewinds = rewinds
        self._due = due.tolist()
        self._elapsed = 0
        self._now: int | None = None

    @property
    def ended(self) -> bool:
        return self.position >= len(self._due)

    def advance(self, now: int) -> None:
        """It is `now`, microseconds of test time."""
        if self.playing and self._now is not None:
            self._elapsed += now - self._now
        self._now = now

    def when(self, position: int, in_next_round: bool = False) -> int:
        """The test time at which an entry is due, in microseconds."""
        due: int = self._due[position] + (self._due[-1] if in_next_round else 0)
        return (self._now or 0) + due - self._elapsed

    def take(self) -> tuple[int, int] | None:
        """The next entry that is due, by number, and the test time at which it was; None when there is none."""
        if self.ended and self.rewinds:
            self._elapsed = self._elapsed - self._due[-1] if self._due[-1] else 0
            self.position, self.round = 0, self.round + 1
            return None  # one round per update, as a part may have no duration
        if self.ended or not self.playing or self._due[self.position] > self._elapsed:
            return None
        due = self._due[self.position]
        self.position += 1
        return self.position - 1, (self._now or 0) - (self._elapsed - due)
