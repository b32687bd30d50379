"""The messages of OpenDLV by name and id, and their encoding as libcluon writes and reads it."""

import builtins
import difflib
from collections.abc import Container, Iterable
from functools import cache
from pathlib import Path
from typing import Any

from google.protobuf.message import DecodeError, Message

from dodo_dsl.opendlv import odvd, wire
from dodo_dsl.opendlv.numbers import is_whole, whole
from dodo_dsl.opendlv.odvd import INTEGER_BITS, Definition, OdvdError, integer_range, shipped
from dodo_dsl.opendlv.protobuf_classes import Layout, build


class MessageError(ValueError):
    """A message that cannot be encoded, or a payload that cannot be decoded."""


def decode(layout: Layout, payload: bytes) -> Any:
    """The message in a payload; raises MessageError.

    protobuf lets the last of equal fields count and merges messages: a changed size reveals that.
    """
    try:
        message = layout.type.FromString(payload)
        message.DiscardUnknownFields()
        if message.ByteSize() != len(payload):
            message = layout.type.FromString(wire.keep_first(payload, layout.shape))
            message.DiscardUnknownFields()
        _check_decoded(message, layout)
    except (DecodeError, wire.WireError) as error:
        raise MessageError(f"the payload is not a valid {layout.definition.name}: {error}") from None
    return message


def _check_ranges(message: Message, layout: Layout) -> None:
    for field, type_ in layout.narrow:
        if getattr(message, field) not in integer_range(type_):
            raise MessageError(f"{layout.definition.name}.{field} is {type_} and cannot be {getattr(message, field)}")
    for field, inner in layout.inner.items():
        _check_ranges(getattr(message, field), inner)


def _check_decoded(message: Message, layout: Layout) -> None:
    """Strings must be UTF-8 (others are bytes in protobuf); large integers lose their upper bits as in C++."""
    for field in layout.texts:
        if not isinstance(getattr(message, field), str):
            raise wire.WireError(f"'{field}' is not UTF-8 text")
    for field, type_ in layout.narrow:
        value, mask = getattr(message, field), 2 ** INTEGER_BITS[type_] - 1
        if value not in integer_range(type_):
            is_signed = type_.startswith("int")
            setattr(message, field, wire.unzigzag(wire.zigzag(value) & mask) if is_signed else value & mask)
    for field, inner in layout.inner.items():
        if message.HasField(field):
            _check_decoded(getattr(message, field), inner)


_RESERVED = range(2900, 3000)
OWN_IDS = frozenset(_RESERVED) - frozenset(range(2910, 2920))
"""DoDo's, about a test. Beside them are messages of robots (``robot.*``), which are played and judged as all others."""


class UnknownMessage(MessageError, KeyError):
    """A name or an id that the message set does not hold."""

    def __str__(self) -> str:
        return str(self.args[0])


class MessageSet:
    """Messages by full name (``opendlv.proxy.GroundSteeringRequest``) and by id (1090).

    Message classes are protobuf's, with the field names of the specification. All that take a name, an id or a message
    raise UnknownMessage for one that the set does not hold.
    """

    def __init__(self, definitions: Iterable[Definition]) -> None:
        self._layouts = build(definitions)
        self._by_id = {layout.definition.id: layout for layout in self._layouts.values()}

    @classmethod
    def standard(cls) -> "MessageSet":
        return _standard()

    @classmethod
    def load(cls, *paths: Path, kept: Container[str] = ()) -> "MessageSet":
        """The standard messages and those of the files, which replace standard ones of the same name or id.

        Standard ones whose names are ``kept`` are not replaced; their ids may have two meanings. Raises OdvdError, also
        if two of the files disagree or use what is DoDo's own.
        """
        own = [each for each in merged(paths) if each.name not in kept]
        return cls([*besides(own, shipped(), kept), *own]) if paths else _standard()

    def names(self) -> tuple[str, ...]:
        return tuple(sorted(self._layouts))

    def type(self, key: str | int) -> builtins.type[Any]:
        return self.layout(key).type

    def id(self, key: Message | builtins.type[Message] | str) -> int:
        """The id of a message, of its class or of its full name."""
        name = key if isinstance(key, str) else key.DESCRIPTOR.full_name
        return self.layout(name).definition.id

    def key(self, text: str) -> tuple[int, int | None]:
        """Id and sender stamp of a name or an id as people write them, with ``/senderStamp`` or None for any."""
        name, slash, stamp = text.partition("/")
        if slash and not is_whole(stamp):
            raise MessageError(f"'{text}' is not a message: expected a sender stamp, a number, after the slash")
        return whole(name) if is_whole(name) else self.id(name), whole(stamp) if slash else None

    def ids(self) -> frozenset[int]:
        return frozenset(self._by_id)

    def name(self, id_: int) -> str:
        return self.layout(id_).definition.name

    def encode(self, message: Message) -> bytes:
        """The payload as libcluon writes it: every field in order, zeros and defaults too.

        Raises MessageError if a number does not fit its type, UnknownMessage for a message of another set.
        """
        layout = self.layout(message.DESCRIPTOR.full_name)
        if layout.narrow or layout.inner:
            _check_ranges(message, layout)
        data: bytes = message.SerializeToString()
        if len(data) != layout.fixed_size:
            data = layout.type.FromString(layout.filled + data).SerializeToString()
        return data

    def decode(self, id_: int, payload: bytes) -> Any:
        """The message in a payload: fields in any order, the first of equal ones counts, absent ones default.

        Raises MessageError for bytes that are not such a message, UnknownMessage for an unknown id.
        """
        return decode(self.layout(id_), payload)

    def layout(self, key: str | int) -> Layout:
        layout = self._by_id.get(key) if isinstance(key, int) else self._layouts.get(key)
        if layout is None:
            close = [name for name in self._layouts if name.rpartition(".")[2] == str(key).rpartition(".")[2]]
            close = close or difflib.get_close_matches(str(key), self._layouts, 1)
            hint = f": did you mean '{close[0]}'?" if close else ""
            raise UnknownMessage(f"there is no message '{key}'{hint}")
        return layout


def besides(first: Iterable[Definition], others: Iterable[Definition], kept: Container[str] = ()) -> list[Definition]:
    """Those of the others whose name and id no message of the first has, and those whose names are ``kept``."""
    taken = {key for definition in first for key in (definition.name, definition.id)}
    return [each for each in others if each.name in kept or taken.isdisjoint((each.name, each.id))]


@cache
def _standard() -> MessageSet:
    return MessageSet(shipped())


def merged(paths: Iterable[Path]) -> list[Definition]:
    """The messages of ODVD files, each once; raises OdvdError."""
    by_key: dict[str | int, Definition] = {}
    for definition in (definition for path in paths for definition in odvd.load(path)):
        if definition.id in _RESERVED or definition.name.startswith("dodo."):
            raise OdvdError(f"{definition.place}: ids 2900 to 2999 and names that begin with 'dodo.' are DoDo's own")
        for key in (definition.name, definition.id):
            earlier = by_key.setdefault(key, definition)
            if not earlier.same_layout(definition):
                raise OdvdError(f"{definition.place}: '{key}' is another message at {earlier.place}")
    return list({id(definition): definition for definition in by_key.values()}.values())
