"""The part of a recording to play (a span of time, some messages, one camera's pictures), and where its player is.

A player goes by test time and by commands; it is pure, without a recording.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.message_columns import Marks, Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet, UnknownMessage
from dodo_dsl.opendlv.recording import Recording, matching


class SelectionError(ValueError):
    """A wrong selection, or one that leaves nothing to play; one sentence."""


@dataclass(frozen=True)
class Selection:
    """Seconds count from the recording's first message; `messages` and `without` name messages on the bus.

    Pictures (ImageReading) of ``video_sender`` are shown, unless that is None; they are sent on the bus only with
    ``send_video``. DoDo's own messages of an earlier test are never sent.
    """

    start: float = 0.0
    end: float | None = None
    messages: Sequence[str] = ()
    without: Sequence[str] = ()
    video_sender: int | None = 0
    send_video: bool = False


@dataclass(frozen=True)
class Part:
    """Rows of a recording in the order in which they are played: when (microseconds from the start), and how.

    `shown` marks the pictures for the memory, `sent` the messages for the bus; each row is one of them or both.
    """

    rows: Numbers
    due: Numbers
    sent: Marks
    shown: Marks

    def __len__(self) -> int:
        return len(self.rows)


def select(recording: Recording, selection: Selection, known: MessageSet, max_gap: int, timemod: float = 1.0) -> Part:
    """The part that is played, as ``recording_times.played`` has it; raises SelectionError."""
    stretch, _, due = recording_times.played(recording, selection.start, selection.end, max_gap, timemod)
    if fault := recording_times.fault(recording, np.sort(stretch)):
        raise SelectionError(f"{recording.path} cannot be played: {fault}")
    index = recording.index[stretch]
    images = index["data_type"] == IMAGE
    sent = ~(images & (not selection.send_video)) & ~_named(index, selection.without, known)
    if selection.messages:
        sent &= _named(index, selection.messages, known)
    shown = images & (index["sender_stamp"] == selection.video_sender)
    chosen = np.flatnonzero(sent | shown)
    if not len(chosen):
        raise SelectionError(f"{recording.path} has no message in the selected part")
    return Part(stretch[chosen], due[chosen], sent[chosen], shown[chosen])


def _named(index: np.ndarray, texts: Sequence[str], known: MessageSet) -> Marks:
    try:
        return matching(index, map(known.key, texts))
    except MessageError as error:
        hint = " (or give an id)" if isinstance(error, UnknownMessage) else ""
        raise SelectionError(f"{error}{hint}") from None


PLAY, PAUSE, SEEK, STEP = 1, 2, 3, 4

_log = logging.getLogger(__name__)


class Player:
    """Computes which entries are due. ``due`` holds the time of each in microseconds from the start, ascending.

    It waits for `play` before anything is due. With `rewinds` it begins again at its end; else it is `ended` then.
    """

    def __init__(self, due: Numbers, rewinds: bool = False) -> None:
        self.position = 0
        self.playing = False
        self.jumped = False
        self._due = due.tolist()
        self.rewinds = rewinds
        self._elapsed = 0
        self._now: int | None = None
        self._steps = 0

    def __len__(self) -> int:
        return len(self._due)

    @property
    def ended(self) -> bool:
        """Whether all has been played."""
        return self.position >= len(self._due)

    def play(self) -> None:
        """Play from here."""
        self.playing = True

    def command(self, command: int, seek_to: float) -> None:
        """PlayerCommand: play, pause, seek to a share (0 to 1) of the entries, or step by one entry, which pauses."""
        if command == PLAY:
            self.play()
        elif command == PAUSE:
            self.playing = False
        elif command == STEP:
            self.playing = False
            self._steps += 1
        elif command == SEEK and 0.0 <= seek_to <= 1.0:
            self._seek(min(int(len(self) * seek_to), len(self) - 1))
        else:
            _log.warning(
                "unknown player command %d to %g, expected 1 play, 2 pause, 3 seek 0 to 1, 4 step", command, seek_to
            )

    def advance(self, now: int) -> None:
        """It is `now`, microseconds of test time."""
        if self.playing and self._now is not None:
            self._elapsed += now - self._now
        self._now = now

    def when(self, position: int, in_next_round: bool = False) -> int:
        """The test time at which an entry is due if the player is not paused before."""
        due: int = self._due[position] + (self._due[-1] if in_next_round else 0)
        return (self._now or 0) + due - self._elapsed

    def take(self) -> tuple[int, int] | None:
        """The next entry that is due, by number, and the test time at which it was; None when there is none."""
        if self.ended and self.rewinds and self.playing:
            self._elapsed = self._elapsed - self._due[-1] if self._due[-1] else 0
            self.position, self.jumped = 0, True
            return None  # one round per update, as a part may have no duration
        if self.ended:
            return None
        due = self._due[self.position]
        if self._steps:
            self._steps -= 1
            self._elapsed = due
        elif not self.playing or due > self._elapsed:
            return None
        self.position += 1
        return self.position - 1, (self._now or 0) - (self._elapsed - due)

    def _seek(self, position: int) -> None:
        self.position, self.jumped = position, True
        self._elapsed = self._due[position]
