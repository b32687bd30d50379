"""Frames of a recording as a table of numbers: a column of 64 bits for each fact, a row a frame.

Frames as libcluon writes them are read thousands at once; others one by one, with the same result.
"""

from enum import IntEnum
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import message_columns, wire
from dodo_dsl.opendlv.address import HEADER_BYTES, MAGIC, FrameError
from dodo_dsl.opendlv.envelope import LAYOUT, decode_frame, decode_parts, encode_frame
from dodo_dsl.opendlv.message_columns import Numbers

PADDING = bytes(128)  # what a reader of the last frame may look at beyond it
FEW = 16


class Fact(IntEnum):
    """The columns, an envelope's in the order of its fields; positions are in the data at hand, times as written."""

    START = 0
    END = 1
    DATA_TYPE = 2
    PAYLOAD = 3
    PAYLOAD_END = 4
    SENT_S = 5
    SENT_US = 6
    RECEIVED_S = 7
    RECEIVED_US = 8
    SAMPLED_S = 9
    SAMPLED_US = 10
    SENDER_STAMP = 11


Table = NDArray[np.int64]  # (len(Fact), frames)


def read_frames(data: bytes, starts: list[int], ends: list[int], known: bool = False) -> Table:
    """The rows of frames up to the first that holds no envelope; ``data`` ends with PADDING.

    ``known`` frames were read before.
    """
    table, left = np.empty((len(Fact), len(starts)), np.int64), list(range(len(starts)))
    if len(starts) >= FEW:
        table, left = _at_once(data, np.array(starts, np.int64), np.array(ends, np.int64))
    for row in left:
        found = _one(data, starts[row], ends[row], known)
        if found is None:
            return table[:, :row]
        table[:, row] = found
    return table


def _at_once(data: bytes, starts: Numbers, ends: Numbers) -> tuple[Table, list[int]]:
    """All rows, and which of them are left as their frames are not as libcluon writes them."""
    reader = message_columns.Reader(data, ends)
    at = reader.message(LAYOUT, starts + HEADER_BYTES)
    kind, payload, *others = (values for _, _, values in reader.columns)
    table = np.array([starts, ends, kind, *payload, *others], np.int64)
    return table, np.flatnonzero(~(reader.usual & (at == ends))).tolist()


def _one(data: bytes, start: int, end: int, known: bool) -> tuple[int, ...] | None:
    at = start + HEADER_BYTES
    try:
        for _ in islice(wire.chunks(memoryview(data)[at:end]), FEW):
            pass  # a false header may claim 16 MiB, and those are not copied
        kind, payload, times, stamp = decode_parts(data[at:end])
    except (FrameError, wire.WireError):
        return None
    if not known and _is_doubtful(data, start, end):
        return None
    at = data.find(payload, at, end)
    return start, end, kind, at, at + len(payload), *times, stamp


def _is_doubtful(data: bytes, start: int, end: int) -> bool:
    """Whether a frame was cut and took bytes of the next ones, which happen to make an envelope with its own.

    Such a one has a header inside, none behind it, and is not as libcluon writes it.
    """
    if end + len(PADDING) >= len(data) or data.startswith(MAGIC, end) or data.find(MAGIC, start + 1, end) < 0:
        return False
    return encode_frame(decode_frame(data[start:end])) != data[start:end]
