"""Many protobuf numbers read at once: an array of positions gives an array of values.

Reference: Protocol Buffers, "Encoding", base 128 varints. Numbers of more than 8 bytes are left to others.
"""

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint64]
Numbers = NDArray[np.int64]
Marks = NDArray[np.bool_]

WORD_BYTES = 8
_STOP_BITS = np.uint64(0x8080808080808080)
_VALUE_BITS = np.uint64(0x7F7F7F7F7F7F7F7F)
_FOLDS = (
    (np.uint64(0x007F007F007F007F), np.uint64(0x7F007F007F007F00), np.uint64(1)),
    (np.uint64(0x00003FFF00003FFF), np.uint64(0x3FFF00003FFF0000), np.uint64(2)),
    (np.uint64(0x000000000FFFFFFF), np.uint64(0x0FFFFFFF00000000), np.uint64(4)),
)
_LENGTHS = np.uint64(0x0102030405060708)
_ONE, _SEVEN, _TOP_BYTE = np.uint64(1), np.uint64(7), np.uint64(56)


def words(data: bytes) -> Words:
    """The 8 bytes that begin at each position of ``data``, as one little-endian number."""
    return np.ndarray((max(0, len(data) - WORD_BYTES + 1),), "<u8", data, strides=(1,))


def read(source: Words, at: Numbers) -> tuple[Numbers, Numbers]:
    """The numbers at some positions, and their lengths in bytes; 0 where one has no end within 8 bytes."""
    word = source[at]
    stops = ~word & _STOP_BITS
    last = stops & (~stops + _ONE)
    value = word & (last - _ONE) & _VALUE_BITS
    for kept, moved, shift in _FOLDS:
        value = (value & kept) | ((value & moved) >> shift)
    length = ((last >> _SEVEN) * _LENGTHS) >> _TOP_BYTE
    return value.view(np.int64), length.view(np.int64)


def signed(value: Numbers) -> Numbers:
    """The value of a zigzag number."""
    result: Numbers = (value >> 1) ^ -(value & 1)
    return result
