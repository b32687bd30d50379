"""Times of a recording that cannot be right: they would put messages where none belongs, and judge by that."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.message_columns import Marks, Numbers
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageSet
from dodo_dsl.opendlv.recording import Recording

DAY = 86_400_000_000
MOST_BACK = 1_000_000
"""Microseconds that a message may lie before the one before it of the same sender; images must be in order."""
TOOLS = range(1, 13)
"""Ids of messages of players and recorders, whose times are those of the tool."""


def together(times: Numbers) -> Marks:
    """Which times in us are of the largest group without a gap of a day; the earliest of such groups."""
    if not len(times) or times.max() - times.min() <= DAY:
        return np.ones(len(times), np.bool_)
    ordered = np.sort(times)
    groups = np.split(ordered, np.flatnonzero(np.diff(ordered) > DAY) + 1)
    largest = max(groups, key=len)
    within: Marks = (times >= largest[0]) & (times <= largest[-1])
    return within


def within(recording: Recording, rows: Numbers) -> Numbers:
    """The times of rows in us; those of tools lie at the start or end of the others where they are outside."""
    times: Numbers = recording.index["time"][rows]
    others = times[~np.isin(recording.index["data_type"][rows], list(TOOLS))]
    return np.clip(times, others.min(), others.max()) if len(others) else times


def played(
    recording: Recording, start: float, end: float | None, max_gap: int, timemod: float
) -> tuple[Numbers, Numbers, Numbers]:
    """The rows that a player plays from ``start`` to ``end`` (s since the first message), in its order.

    With them are their times, and when they are due, in us, with gaps of ``max_gap`` us at most. A message without a
    sample time has its place by when it was received, or else sent. Gaps are those between neighbours, whatever of
    them is chosen; then all goes ``timemod`` times faster. DoDo's messages are left out.
    """
    index, second = recording.index, 1_000_000
    begin = int(index["time"][index["time"] > 0].min(initial=1 << 62))
    # the whole recording includes messages without a time, a part does not
    part = (begin + round(start * second) if start else None, None if end is None else begin + round(end * second))
    rows = recording.rows(start=part[0], end=part[1])
    rows = rows[~np.isin(index["data_type"][rows], list(OWN_IDS))]
    times = within(recording, rows)
    order = np.argsort(times, kind="stable")
    rows, times = rows[order], times[order]
    gaps = np.minimum(np.diff(times, prepend=times[:1]), max_gap)
    return rows, times, np.rint(np.cumsum(gaps) / timemod).astype(np.int64)


def fault(recording: Recording, rows: Numbers, in_order: bool = True) -> str:
    """What is wrong with the times of rows, in a sentence with the first of them; empty if they may be right.

    ``time`` counts: the sample time, or if that is zero when the message was received, or else sent. With
    ``in_order`` those of a message and sender must not go back, nor a message repeat.
    """
    rows = rows[~np.isin(recording.index["data_type"][rows], list(TOOLS))]
    times = recording.index["time"][rows]
    for wrong, what in ((times == 0, "has no time at all"), (~together(times), "has a time days from the others'")):
        if wrong.any():
            return f"{place(recording, int(rows[wrong][0]))} {what}, one of {wrong.sum():,} such messages"
    parts = streams(recording.index, rows) if in_order else ()
    return next((text for part in parts if (text := _disorder(recording, part))), "")


def repeated(recording: Recording, rows: Numbers) -> str:
    """Which message is in the file twice, byte for byte, with the same times; empty if none is."""
    index = recording.index[rows]
    keys = np.stack([index[name].astype(np.int64) for name in ("data_type", "sender_stamp", "time", "size")])
    order = np.lexsort(keys[::-1])
    alike = np.all(keys[:, order][:, 1:] == keys[:, order][:, :-1], axis=0)
    members = np.zeros(len(rows), np.bool_)
    members[order[1:][alike]] = members[order[:-1][alike]] = True
    seen: dict[bytes, int] = {}
    frames = (frame for batch in recording.batches(rows[members]) for frame in batch.frames())
    for row, frame in zip(rows[members].tolist(), frames, strict=True):
        if (first := seen.setdefault(frame, row)) != row:
            return f"{place(recording, row)} is there twice, as message {first + 1:,} already"
    return ""


def _disorder(recording: Recording, rows: Numbers) -> str:
    """A step back in the times of one message and sender; small ones come of the way to the recorder."""
    times = recording.index["time"][rows]
    least = 0 if recording.index["data_type"][rows[0]] == IMAGE else MOST_BACK
    back = np.flatnonzero(np.diff(times) < -least)
    if not len(back):
        return repeated(recording, rows)
    size = float(times[back[0]] - times[back[0] + 1]) / 1e6
    return f"{place(recording, int(rows[back[0] + 1]))} goes back in time, by {size:,.6g} s"


def streams(index: NDArray[np.void], rows: Numbers) -> Iterator[Numbers]:
    """The rows of each message and sender stamp, in their order."""
    keys = index["data_type"][rows].astype(np.int64) << 32 | index["sender_stamp"][rows]
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order])) + 1
    yield from (rows[part] for part in np.split(order, cuts) if len(part))


def place(recording: Recording, row: int) -> str:
    """Where a message is in its file."""
    entry, known = recording.index[row], MessageSet.standard()
    id_ = int(entry["data_type"])
    name = known.name(id_) if id_ in known.ids() else str(id_)
    return f"message {row + 1:,} ({name}/{entry['sender_stamp']}, at byte {entry['offset']:,})"
