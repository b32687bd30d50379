"""The part of a recording that a command is about: some messages, and a stretch of time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dodo_dsl.opendlv.messages.message_set import MessageSet, UnknownMessage
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording

ABSOLUTE_S = 1e8  # seconds from here on are counted since 1970


class NothingSelected(Exception):
    """A selection that is wrong or holds no message; one sentence."""


@dataclass(frozen=True)
class Selection:
    """`messages` are names or ids, each with `/senderStamp` where one sender counts; none means all.

    `start` and `end` are seconds since the recording's begin, or since 1970.
    """

    messages: Sequence[str] = ()
    start: float | None = None
    end: float | None = None

    def rows(self, recording: Recording, known: MessageSet) -> Numbers:
        """The rows in the order of the file; raises NothingSelected."""
        times = recording.index["time"]
        begin = int(times[times != 0].min(initial=np.iinfo(np.int64).max))
        rows = recording.rows(start=_microseconds(self.start, begin), end=_microseconds(self.end, begin))
        if self.messages:
            index = recording.index[rows]
            chosen = np.zeros(len(rows), np.bool_)
            for text in self.messages:
                id_, stamp = _parsed(text, known)
                chosen |= (index["data_type"] == id_) & (stamp is None or index["sender_stamp"] == stamp)
            rows = rows[chosen]
        if not len(rows):
            raise NothingSelected(f"nothing is selected: no message of {recording.path} is {self}")
        return rows

    def __str__(self) -> str:
        parts = [" or ".join(self.messages)] if self.messages else ["there"]
        parts += [f"from {self.start:g} s"] if self.start is not None else []
        parts += [f"before {self.end:g} s"] if self.end is not None else []
        return ", ".join(parts)


def _microseconds(seconds: float | None, begin: int) -> int | None:
    if seconds is None:
        return None
    return round(seconds * 1e6) + (0 if seconds >= ABSOLUTE_S else begin)


def _parsed(text: str, known: MessageSet) -> tuple[int, int | None]:
    name, slash, stamp = text.partition("/")
    if slash and not stamp.isdecimal():
        raise NothingSelected(f"`{text}` is no message: after the slash stands a sender stamp, a number")
    try:
        id_ = int(name) if name.isdecimal() else known.id(name)
    except UnknownMessage as error:
        raise NothingSelected(str(error)) from None
    return id_, int(stamp) if slash else None
