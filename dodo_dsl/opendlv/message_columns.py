"""Payloads of one message decoded thousands at once: an array for each field.

Payloads as libcluon writes them, every field once and in order, are read together; others through the codec.
Reference: Protocol Buffers, "Encoding", base 128 varints. Numbers of more than 8 bytes are left to the codec, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import message_set
from dodo_dsl.opendlv.odvd import INTEGER_BITS
from dodo_dsl.opendlv.protobuf_classes import Layout
from dodo_dsl.opendlv.wire import DELIMITED, EIGHT_BYTES, FOUR_BYTES, VARINT, varint

Words = NDArray[np.uint64]
Numbers = NDArray[np.int64]
Marks = NDArray[np.bool_]
Places = tuple[Numbers, Numbers]
"""Where bytes begin and end."""

_STOP_BITS = np.uint64(0x8080808080808080)
_VALUE_BITS = np.uint64(0x7F7F7F7F7F7F7F7F)
_FOLDS = (
    (np.uint64(0x007F007F007F007F), np.uint64(0x7F007F007F007F00), np.uint64(1)),
    (np.uint64(0x00003FFF00003FFF), np.uint64(0x3FFF00003FFF0000), np.uint64(2)),
    (np.uint64(0x000000000FFFFFFF), np.uint64(0x0FFFFFFF00000000), np.uint64(4)),
)
_LENGTHS = np.uint64(0x0102030405060708)
_ONE, _SEVEN, _TOP_BYTE = np.uint64(1), np.uint64(7), np.uint64(56)


def read_varints(source: Words, at: Numbers) -> tuple[Numbers, Numbers]:
    """The numbers at some positions, and their lengths in bytes; 0 if one has no end within 8 bytes."""
    word = source[at]
    stops = ~word & _STOP_BITS
    last = stops & (~stops + _ONE)
    value = word & (last - _ONE) & _VALUE_BITS
    for kept, moved, shift in _FOLDS:
        value = (value & kept) | ((value & moved) >> shift)
    length = ((last >> _SEVEN) * _LENGTHS) >> _TOP_BYTE
    return value.view(np.int64), length.view(np.int64)


_WIRE_TYPES = {"float": FOUR_BYTES, "double": EIGHT_BYTES, "string": DELIMITED, "bytes": DELIMITED}
_MAX_SIZE = 1 << 25


@dataclass(frozen=True)
class Column:
    """A field's values, a row each: an array of numbers, or a list of bytes, also for strings (UTF-8 or not).

    Fields of inner messages are named ``outer.inner``, as libcluon's CSV has them.
    """

    name: str
    type: str
    values: Any


def column_names(layout: Layout, prefix: str = "") -> Iterator[tuple[str, str]]:
    for field in layout.definition.fields:
        if field.name in layout.inner:
            yield from column_names(layout.inner[field.name], f"{field.name}.")
        else:
            yield prefix + field.name, field.type


def decode(layout: Layout, data: bytes, starts: Numbers, ends: Numbers) -> tuple[list[Column], Marks]:
    """The columns of the payloads between ``starts`` and ``ends``, and which of them could be decoded.

    ``data`` has 128 bytes to spare behind the last payload. Rows that could not be decoded hold anything.
    """
    reader = Reader(data, ends)
    at = reader.message(layout, starts)
    usual = reader.usual & (at == ends)
    good = usual.copy()
    columns = [Column(name, type_, _cut(data, values)) for name, type_, values in reader.columns]
    for row in np.flatnonzero(~usual).tolist():
        try:
            message = message_set.decode(layout, data[int(starts[row]) : int(ends[row])])
        except message_set.MessageError:
            continue
        good[row] = True
        for column, value in zip(columns, _values(layout, message), strict=True):
            column.values[row] = value
    return columns, good


def usual_rows(layout: Layout, data: bytes, starts: Numbers, ends: Numbers) -> Marks:
    """Which payloads are this message as libcluon writes it."""
    reader = Reader(data, ends)
    whole: Marks = reader.message(layout, starts) == ends
    return whole & reader.usual


class Reader:
    """Moves over all payloads field by field; ``usual`` shows which of them still look as libcluon writes them.

    ``columns`` have name, type and values of each field: an array of numbers, or the Places of bytes and strings.
    """

    def __init__(self, data: bytes, ends: Numbers) -> None:
        self.columns: list[tuple[str, str, Any]] = []
        self.usual: Marks = np.ones(len(ends), np.bool_)
        self._data, self._ends = data, ends
        self._octets = np.frombuffer(data, np.uint8)
        self._words: Words = np.ndarray((max(0, len(data) - 7),), "<u8", data, strides=(1,))
        """The 8 bytes that begin at each position."""

    def message(self, layout: Layout, at: Numbers, prefix: str = "") -> Numbers:
        for field in layout.definition.fields:
            inner = layout.inner.get(field.name)
            at = self._key(field.number, DELIMITED if inner else _WIRE_TYPES.get(field.type, VARINT), at)
            if inner is None:
                values, at = self._scalar(field.type, at)
                self.columns.append((prefix + field.name, field.type, values))
            else:
                size, at = self._size(at)
                end = at + size
                at = self.message(inner, at, f"{field.name}.")
                self.usual &= at == end
                at = np.minimum(at, self._ends)
        return at

    def _key(self, number: int, wire_type: int, at: Numbers) -> Numbers:
        for octet in varint(number << 3 | wire_type):
            self.usual &= (self._octets[at] == octet) & (at < self._ends)
            at = at + 1
        return np.minimum(at, self._ends)

    def _scalar(self, type_: str, at: Numbers) -> tuple[Any, Numbers]:
        if type_ in ("float", "double"):
            size, kind = (4, "<f4") if type_ == "float" else (8, "<f8")
            source: NDArray[Any] = np.ndarray((len(self._data) - size + 1,), kind, self._data, strides=(1,))
            return source[at], np.minimum(at + size, self._ends + 1)
        if type_ in ("string", "bytes"):
            length, at = self._size(at)
            self.usual &= at + length <= self._ends
            end = np.minimum(at + length, self._ends)
            return (at, end), end
        value, length = read_varints(self._words, at)
        bits = 1 if type_ == "bool" else INTEGER_BITS[type_]
        self.usual &= length > 0
        if bits < 64:
            self.usual &= value < 1 << bits
        if type_.startswith("int"):
            value = (value >> 1) ^ -(value & 1)
        return (value.astype(object) if bits == 64 else value), np.minimum(at + length, self._ends + 1)

    def _size(self, at: Numbers) -> tuple[Numbers, Numbers]:
        size, length = read_varints(self._words, at)
        self.usual &= (length > 0) & (size < _MAX_SIZE) & (at + length <= self._ends)
        return np.minimum(size, _MAX_SIZE), np.minimum(at + length, self._ends)


def _cut(data: bytes, values: Any) -> Any:
    is_text = isinstance(values, tuple)
    return [data[begin:end] for begin, end in np.stack(values, 1).tolist()] if is_text else values


def _values(layout: Layout, message: Any) -> Iterator[Any]:
    for field in layout.definition.fields:
        value = getattr(message, field.name)
        if field.name in layout.inner:
            yield from _values(layout.inner[field.name], value)
        else:
            yield value.encode() if isinstance(value, str) else value
