"""Message specifications (``.odvd``), the language of libcluon's ``cluon-msc``: their parser and field types.

    package a.b;                                  // optional
    message Name [id = 1] {
      uint8 level [default = 6, id = 1];
    }

Fields without an id are counted from 1 in their order. An error names file, line and column.
"""

import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.opendlv import regular_file


class OdvdError(ValueError):
    """A specification that cannot be used; the text begins with ``file:line:column``."""

    usage = True


class TextPlace(NamedTuple):
    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


INTEGER_BITS = {"char": 8} | {f"{kind}{bits}": bits for bits in (8, 16, 32, 64) for kind in ("uint", "int")}
NUMBERS = frozenset(INTEGER_BITS) | {"bool", "float", "double"}
SCALARS = NUMBERS | {"string", "bytes"}

Default = bool | int | float | str | None


def integer_range(type_: str) -> range:
    bits = INTEGER_BITS[type_]
    return range(-(2 ** (bits - 1)), 2 ** (bits - 1)) if type_.startswith("int") else range(2**bits)


def default_of(type_: str, text: str) -> Default:
    """The default that is written for a field of a type; raises ValueError."""
    if type_ == "bool":
        return {"true": True, "false": False}[text]
    if type_ in ("string", "bytes") and text[0] == '"':
        return text[1:-1]
    if type_ == "char" and text[0] == "'" and ord(text[1]) in integer_range(type_):
        return ord(text[1])
    if type_ in ("float", "double"):
        return float(text)
    if type_ in INTEGER_BITS and int(text) in integer_range(type_):
        return int(text)
    raise ValueError


MAX_FILE_BYTES = 1_000_000
MAX_FIELD_NUMBER = 2**29 - 1
MAX_MESSAGE_ID = 2**31 - 1


@dataclass(frozen=True)
class Field:
    """One field: ``type`` is a scalar's name, or the message's as it was written."""

    name: str
    type: str
    number: int
    default: Default
    place: TextPlace


@dataclass(frozen=True)
class Definition:
    name: str
    id: int
    package: str
    fields: tuple[Field, ...]
    place: TextPlace

    @property
    def numbers(self) -> dict[str, bool]:
        """The fields that are numbers, each with whether it is a float and not a double."""
        return {each.name: each.type == "float" for each in self.fields if each.type in NUMBERS}

    def same_layout(self, other: "Definition") -> bool:
        """Whether both describe the same name, id and fields, wherever they are defined."""
        return self._layout() == other._layout()

    def fits(self, standard: "Definition") -> bool:
        """Whether programs that know only one of both understand each other: this may have more fields.

        An only field may have another name.
        """
        fields = {each.number: each for each in self.fields}
        is_only = len(self.fields) == len(standard.fields) == 1
        return self.id == standard.id and all(
            (mine := fields.get(each.number)) is not None
            and (is_only or mine.name == each.name)
            and _form(mine.type) == _form(each.type)
            for each in standard.fields
        )

    def __str__(self) -> str:
        fields = "".join(f"{each.type} {each.name} [id = {each.number}]; " for each in self.fields)
        return f"{self.name} [id = {self.id}] {{ {fields}}}"

    def _layout(self) -> tuple[object, ...]:
        return (self.name, self.id, [(f.name, f.type, f.number, f.default) for f in self.fields])


def _form(type_: str) -> str:
    """What protobuf writes alike has the same form."""
    form = type_.rstrip("0123456789")
    return {"char": "uint", "bool": "uint", "string": "bytes"}.get(form, form)


def load(path: Path) -> tuple[Definition, ...]:
    """The messages of a file in their order; raises OdvdError."""
    try:
        text = regular_file.text(path, MAX_FILE_BYTES)
    except OSError as error:
        raise OdvdError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise OdvdError(f"{path}: not UTF-8 text") from None
    return parse(text, str(path))


@functools.cache
def shipped() -> tuple[Definition, ...]:
    """The messages that DoDo knows by itself, read once."""
    return load(STANDARD)


_QUOTED = r"""\"[^"]*\"|'[^']'"""
_NAME = r"[A-Za-z][A-Za-z0-9_]*"
_NAMES = rf"{_NAME}(?:\.{_NAME})*"
_COMMENT = re.compile(rf"({_QUOTED})|//[^\n]*|/\*.*?\*/", re.DOTALL)
_PACKAGE = re.compile(rf"\s*package\s+({_NAMES})\s*;")
_HEAD = re.compile(rf"\s*message\s+(?P<name>{_NAMES})\s*\[\s*id\s*=\s*(\S*?)\s*,?\s*\]\s*\{{")
_FIELD = re.compile(rf"\s*({_NAMES})\s+(?P<name>{_NAME})\s*(?:\[((?:{_QUOTED}|[^\]\"'])*)\])?\s*;")
_OPTION = re.compile(rf"\s*(id|default)\s*=\s*({_QUOTED}|[^\s,]+)\s*,?")
_END, _SPACE, _WORD = re.compile(r"\s*\}"), re.compile(r"\s*"), re.compile(r"\w+|.|\Z")


def parse(text: str, file: str = "<odvd>") -> tuple[Definition, ...]:
    reader, found = _Reader(text, file), list[Definition]()
    package = match[1] if (match := reader.has(_PACKAGE)) else ""
    while not reader.is_at_end():
        head, place = reader.take(_HEAD, "a message such as 'message Name [id = 1] {'")
        id_, fields, counted = _id(head[2], MAX_MESSAGE_ID, place), list[Field](), 0
        while not reader.has(_END):
            match, at = reader.take(_FIELD, "a field such as 'float x [id = 1];', or '}'")
            number, default = _options(match[1], match[3] or "", at)
            counted += not number
            fields.append(Field(match[2], match[1], number or counted, default, at))
        _refuse_twins((each.place, each.name, each.number) for each in fields)
        name = f"{package}.{head[1]}" if package else head[1]
        found.append(Definition(name, id_, package, tuple(fields), place))
    _refuse_twins((each.place, each.name, each.id) for each in found)
    return tuple(found)


class _Reader:
    """Goes over a text, in which comments count as space."""

    def __init__(self, text: str, file: str) -> None:
        self._text = _COMMENT.sub(lambda match: match[1] or re.sub(r"[^\n]", " ", match[0]), text)
        self._file, self._at = file, 0

    def has(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        match = pattern.match(self._text, self._at)
        self._at = match.end() if match else self._at
        return match

    def is_at_end(self) -> bool:
        self.has(_SPACE)
        return self._at == len(self._text)

    def take(self, pattern: re.Pattern[str], expected: str) -> tuple[re.Match[str], TextPlace]:
        self.has(_SPACE)
        if (match := self.has(pattern)) is None:
            word = _WORD.match(self._text, self._at)
            found = f"'{word[0]}'" if word and word[0] else "the end of the file"
            raise OdvdError(f"{self._place(self._at)}: expected {expected}, found {found}")
        return match, self._place(match.start("name"))

    def _place(self, at: int) -> TextPlace:
        return TextPlace(self._file, self._text.count("\n", 0, at) + 1, at - self._text.rfind("\n", 0, at))


def _options(type_: str, text: str, place: TextPlace) -> tuple[int, Default]:
    number, default, at = 0, None, 0
    while text[at:].strip():
        if (match := _OPTION.match(text, at)) is None:
            raise OdvdError(f"{place}: expected 'id = 1' or 'default = 0' in brackets, found '{text.strip()}'")
        at, value = match.end(), match[2]
        if match[1] == "id":
            number = _id(value, MAX_FIELD_NUMBER, place)
            continue
        try:
            default = default_of(type_, value)
        except (ValueError, KeyError):
            raise OdvdError(f"{place}: {value} is not a default for a field of type '{type_}'") from None
    return number, default


def _id(text: str, maximum: int, place: TextPlace) -> int:
    if not re.fullmatch(r"[1-9][0-9]{0,10}", text) or int(text) > maximum:
        raise OdvdError(f"{place}: expected an id, a whole number from 1 to {maximum}, found '{text}'")
    return int(text)


def _refuse_twins(entries: Iterable[tuple[TextPlace, str, int]]) -> None:
    used: dict[str | int, TextPlace] = {}
    for place, name, id_ in entries:
        for key in (name, id_):
            if (earlier := used.setdefault(key, place)) is not place:
                raise OdvdError(f"{place}: the name or id '{key}' is already used at line {earlier.line}")


STANDARD = Path(__file__).with_name("messages.odvd")
"""The messages of OpenDLV's standard set 1.0, of libcluon and of DoDo."""
STANDARD_0_9 = Path(__file__).with_name("messages-0.9.odvd")
"""What set 0.9 means by ids that 1.0 uses otherwise."""
