"""Message specifications (``.odvd``), the language of libcluon's ``cluon-msc``: their parser and field types.

    package a.b;                                  // optional
    message Name [id = 1] {
      uint8 level [default = 6, id = 1];
    }

Fields without an id are counted from 1 in their order. An error names file, line and column.
"""

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, NoReturn

from dodo_dsl.opendlv import regular_file


class OdvdError(ValueError):
    """A specification that cannot be used; the text begins with ``file:line:column``."""

    usage = True


class TextPlace(NamedTuple):
    """A position in a file; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n]+|//[^\n]*|/\*.*?\*/)
      | (?P<name>[A-Za-z][A-Za-z0-9_]*(?:\.[A-Za-z][A-Za-z0-9_]*)*)
      | (?P<number>[+-]?[0-9]+(?:\.[0-9]*)?)
      | "(?P<string>[^"]*)"
      | '(?P<char>[^'])'
      | (?P<sign>[\[\]{};=,])""",
    re.VERBOSE | re.DOTALL,
)


class Token(NamedTuple):
    kind: str
    text: str
    place: TextPlace

    def __str__(self) -> str:
        return "the end of the file" if self.kind == "end" else f"'{self.text}'"


def tokens(text: str, file: str) -> Iterator[Token]:
    position, line, line_start = 0, 1, 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            place = TextPlace(file, line, position - line_start + 1)
            raise OdvdError(f"{place}: '{text[position]}' is not allowed here")
        kind = match.lastgroup or ""
        if kind != "space":
            yield Token(kind, match[kind], TextPlace(file, line, position - line_start + 1))
        if newlines := match[0].count("\n"):
            line += newlines
            line_start = match.start() + match[0].rindex("\n") + 1
        position = match.end()
    yield Token("end", "", TextPlace(file, line, position - line_start + 1))


INTEGER_BITS = {"char": 8} | {f"{kind}{bits}": bits for bits in (8, 16, 32, 64) for kind in ("uint", "int")}
NUMBERS = frozenset(INTEGER_BITS) | {"bool", "float", "double"}
SCALARS = NUMBERS | {"string", "bytes"}

Default = bool | int | float | str | None


def integer_range(type_: str) -> range:
    """The values that an integer type holds; a ``char`` is 0 to 255."""
    bits = INTEGER_BITS[type_]
    return range(-(2 ** (bits - 1)), 2 ** (bits - 1)) if type_.startswith("int") else range(2**bits)


def default_of(type_: str, token: Token) -> Default:
    """The default that a token gives a field of a type; raises OdvdError."""
    kind, text = token.kind, token.text
    if type_ == "bool" and kind == "name" and text in ("true", "false"):
        return text == "true"
    if type_ in ("float", "double") and kind == "number":
        return float(text)
    if type_ in ("string", "bytes") and kind == "string":
        return text
    if type_ == "char" and kind == "char" and ord(text) in integer_range(type_):
        return ord(text)
    is_whole = type_ in INTEGER_BITS and kind == "number" and re.fullmatch(r"[+-]?[0-9]{1,20}", text)
    if is_whole and int(text) in integer_range(type_):
        return int(text)
    raise OdvdError(f"{token.place}: {token} is not a default for a field of type '{type_}'")


__all__ = ["Definition", "Field", "OdvdError", "TextPlace", "load", "parse"]

MAX_FILE_BYTES = 1_000_000
MAX_FIELD_NUMBER = 2**29 - 1
RESERVED_NUMBERS = range(19_000, 20_000)  # kept by protobuf for itself
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
    """One message: full name, identifier, and fields in the order of the file."""

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
    if type_ in INTEGER_BITS:
        return "int" if type_.startswith("int") else "uint"
    return {"bool": "uint", "string": "bytes"}.get(type_, type_)


def load(path: Path) -> tuple[Definition, ...]:
    """Read and parse one file; raises OdvdError."""
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


def parse(text: str, file: str = "<odvd>") -> tuple[Definition, ...]:
    """The messages of a specification in their order; raises OdvdError."""
    return _Parser(text, file).messages()


class _Parser:
    def __init__(self, text: str, file: str) -> None:
        self._stream = tokens(text, file)
        self._token = next(self._stream)

    def messages(self) -> tuple[Definition, ...]:
        package = ""
        if self._has("name", "package"):
            package = self._expect("name", "the package's name").text
            self._sign(";")
        found: list[Definition] = []
        used: dict[str | int, TextPlace] = {}
        while self._token.kind != "end":
            message = self._message(package)
            _use(used, "message", message.place, message.name, message.id)
            found.append(message)
        return tuple(found)

    def _message(self, package: str) -> Definition:
        if not self._has("name", "message"):
            self._fail("'message'")
        name = self._expect("name", "the message's name")
        self._sign("[")
        id_ = self._identifier(MAX_MESSAGE_ID)
        self._has("sign", ",")
        self._sign("]")
        self._sign("{")
        fields: list[Field] = []
        used: dict[str | int, TextPlace] = {}
        counted = 0
        while not self._has("sign", "}"):
            entry = self._field(counted + 1)
            counted += self._is_counted
            _use(used, "field", entry.place, entry.name, entry.number)
            fields.append(entry)
        full_name = f"{package}.{name.text}" if package else name.text
        return Definition(full_name, id_, package, tuple(fields), name.place)

    def _field(self, counted: int) -> Field:
        type_ = self._expect("name", "a field's type or '}'").text
        name = self._expect("name", "the field's name")
        if "." in name.text:
            raise OdvdError(f"{name.place}: the field name '{name.text}' has a dot, expected a simple name")
        number, default = 0, None
        if self._has("sign", "["):
            while not self._has("sign", "]"):
                if self._has("name", "default"):
                    self._sign("=")
                    default = default_of(type_, self._token)
                    self._next()
                else:
                    number = self._identifier(MAX_FIELD_NUMBER)
                self._has("sign", ",")
        self._sign(";")
        self._is_counted = not number
        if (number or counted) in RESERVED_NUMBERS:
            raise OdvdError(f"{name.place}: field ids 19000 to 19999 are reserved by protobuf")
        return Field(name.text, type_, number or counted, default, name.place)

    def _identifier(self, maximum: int) -> int:
        if not self._has("name", "id"):
            self._fail("'id'")
        self._sign("=")
        token = self._expect("number", "a number")
        if not re.fullmatch(r"[1-9][0-9]*", token.text) or int(token.text[:11]) > maximum:
            raise OdvdError(f"{token.place}: expected an id, a whole number from 1 to {maximum}, found '{token.text}'")
        return int(token.text)

    def _next(self) -> None:
        self._token = next(self._stream, self._token)

    def _has(self, kind: str, text: str) -> bool:
        """Whether this comes; then it is passed."""
        is_there = (self._token.kind, self._token.text) == (kind, text)
        if is_there:
            self._next()
        return is_there

    def _expect(self, kind: str, what: str) -> Token:
        token = self._token
        if token.kind != kind:
            self._fail(what)
        self._next()
        return token

    def _sign(self, sign: str) -> None:
        if not self._has("sign", sign):
            self._fail(f"'{sign}'")

    def _fail(self, expected: str) -> NoReturn:
        raise OdvdError(f"{self._token.place}: expected {expected}, found {self._token}")


def _use(used: dict[str | int, TextPlace], what: str, place: TextPlace, name: str, id_: int) -> None:
    """Note a name and an id; raises OdvdError where one is used a second time."""
    keys: tuple[tuple[str, str | int], ...] = (("name", name), ("id", id_))
    for key, value in keys:
        if (earlier := used.setdefault(value, place)) is not place:
            raise OdvdError(f"{place}: the {key} '{value}' of this {what} is already used at line {earlier.line}")


STANDARD = Path(__file__).with_name("messages.odvd")
"""The messages of OpenDLV's standard set 1.0, of libcluon and of DoDo."""
STANDARD_0_9 = Path(__file__).with_name("messages-0.9.odvd")
"""What set 0.9 means by ids that 1.0 uses otherwise."""
