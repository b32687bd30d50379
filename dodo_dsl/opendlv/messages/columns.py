"""Payloads of one message decoded thousands at once: an array for each field.

Payloads as libcluon writes them, every field once and in order, are read together; others through the codec.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.messages import codec, varints
from dodo_dsl.opendlv.messages.protobuf_classes import Layout
from dodo_dsl.opendlv.messages.varints import Marks, Numbers
from dodo_dsl.opendlv.messages.wire import DELIMITED, EIGHT_BYTES, FOUR_BYTES, VARINT, varint
from dodo_dsl.opendlv.odvd.field_types import INTEGER_BITS

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


def names(layout: Layout, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Name and type of each column of a message."""
    for field in layout.definition.fields:
        if field.name in layout.inner:
            yield from names(layout.inner[field.name], f"{field.name}.")
        else:
            yield prefix + field.name, field.type


def decode(layout: Layout, data: bytes, starts: Numbers, ends: Numbers) -> tuple[list[Column], Marks]:
    """The columns of the payloads between ``starts`` and ``ends``, and which of them could be decoded.

    ``data`` has 128 bytes to spare behind the last payload. Rows that could not be decoded hold anything.
    """
    reader = _Reader(data, ends)
    at = reader.message(layout, starts)
    usual = reader.usual & (at == ends)
    good = usual.copy()
    for row in np.flatnonzero(~usual).tolist():
        try:
            message = codec.decode(layout, data[int(starts[row]) : int(ends[row])])
        except codec.MessageError:
            continue
        good[row] = True
        for (_, _, values), value in zip(reader.columns, _values(layout, message), strict=True):
            values[row] = value
    return [Column(*column) for column in reader.columns], good


def usual_rows(layout: Layout, data: bytes, starts: Numbers, ends: Numbers) -> Marks:
    """Which payloads are this message as libcluon writes it."""
    reader = _Reader(data, ends)
    whole: Marks = reader.message(layout, starts) == ends
    return whole & reader.usual


class _Reader:
    """Moves over all payloads field by field; ``usual`` tells which of them still look as libcluon writes them."""

    def __init__(self, data: bytes, ends: Numbers) -> None:
        self.columns: list[tuple[str, str, Any]] = []
        self.usual: Marks = np.ones(len(ends), np.bool_)
        self._data, self._ends = data, ends
        self._octets = np.frombuffer(data, np.uint8)
        self._words = varints.words(data)

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
            return self._slices(at)
        value, length = varints.read(self._words, at)
        bits = 1 if type_ == "bool" else INTEGER_BITS[type_]
        self.usual &= length > 0
        if bits < 64:
            self.usual &= value < 1 << bits
        value = varints.signed(value) if type_.startswith("int") else value
        return (value.astype(object) if bits == 64 else value), np.minimum(at + length, self._ends + 1)

    def _size(self, at: Numbers) -> tuple[Numbers, Numbers]:
        size, length = varints.read(self._words, at)
        self.usual &= (length > 0) & (size < _MAX_SIZE) & (at + length <= self._ends)
        return np.minimum(size, _MAX_SIZE), np.minimum(at + length, self._ends)

    def _slices(self, at: Numbers) -> tuple[list[bytes], Numbers]:
        size, at = self._size(at)
        end = at + size
        self.usual &= end <= self._ends
        end = np.minimum(end, self._ends)
        data = self._data
        values = [data[a:b] for a, b in zip(at.tolist(), end.tolist(), strict=True)]
        return values, end


def _values(layout: Layout, message: Any) -> Iterator[Any]:
    for field in layout.definition.fields:
        value = getattr(message, field.name)
        if field.name in layout.inner:
            yield from _values(layout.inner[field.name], value)
        else:
            yield value.encode() if isinstance(value, str) else value
