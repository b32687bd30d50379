"""The part of a recording to play: a span of time, some messages, and the pictures of one camera."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import OWN_IDS, MessageSet, UnknownMessage
from dodo_dsl.opendlv.messages.varints import Marks, Numbers
from dodo_dsl.opendlv.recordings import timing
from dodo_dsl.opendlv.recordings.recording import Recording

IMAGE = 1055
MICROSECONDS = 1_000_000


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
    """The part that is played, in the order of its times; raises SelectionError.

    A message without a sample time has its place by when it was received, or else sent. Gaps are those between
    neighbours of the whole stretch, whatever of it is chosen, none larger than `max_gap` (microseconds); then all of it
    goes `timemod` times faster.
    """
    stretch = _stretch(recording, selection)
    stretch = stretch[~np.isin(recording.index["data_type"][stretch], list(OWN_IDS))]
    if fault := timing.fault(recording, stretch):
        raise SelectionError(f"{recording.path} cannot be played: {fault}")
    times = timing.within(recording, stretch)
    order = np.argsort(times, kind="stable")
    stretch, times = stretch[order], times[order]
    index = recording.index[stretch]
    gaps = np.diff(times, prepend=times[:1])
    due = np.rint(np.cumsum(np.minimum(gaps, max_gap)) / timemod).astype(np.int64)
    images = index["data_type"] == IMAGE
    sent = ~(images & (not selection.send_video)) & ~_named(index, selection.without, known)
    if selection.messages:
        sent &= _named(index, selection.messages, known)
    shown = images & (index["sender_stamp"] == selection.video_sender)
    chosen = np.flatnonzero(sent | shown)
    if not len(chosen):
        raise SelectionError(f"{recording.path} has no message in the selected part")
    return Part(stretch[chosen], due[chosen], sent[chosen], shown[chosen])


def _stretch(recording: Recording, selection: Selection) -> Numbers:
    times = recording.index["time"]
    valid = times[times > 0]
    begin = int(valid.min()) if len(valid) else 0
    # the whole recording includes messages without a time, a part does not
    start = begin + round(selection.start * MICROSECONDS) if selection.start else None
    end = None if selection.end is None else begin + round(selection.end * MICROSECONDS)
    return recording.rows(start=start, end=end)


def _named(index: np.ndarray, texts: Sequence[str], known: MessageSet) -> Marks:
    marks: Marks = np.zeros(len(index), np.bool_)
    try:
        keys = list(map(known.key, texts))
    except MessageError as error:
        hint = " (or give an id)" if isinstance(error, UnknownMessage) else ""
        raise SelectionError(f"{error}{hint}") from None
    for id_, stamp in keys:
        marks |= (index["data_type"] == id_) & (stamp is None or index["sender_stamp"] == stamp)
    return marks
