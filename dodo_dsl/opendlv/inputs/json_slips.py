"""What is wrong with text that is not JSON, in our own words: the first mistake, its place, and what to write."""

import json
import re
from dataclasses import dataclass
from typing import Any, NoReturn

_TOKEN = re.compile(
    r'(?P<string>"(?:[^"\\\x00-\x1f]|\\(?:["\\/bfnrt]|u[0-9A-Fa-f]{4}))*")'
    r"|(?P<number>-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?(?![\w.+]))"
    r"|(?P<word>(?:true|false|null|NaN|-?Infinity)\b)|(?P<sign>[{}\[\],:])"
)
_BLANK = re.compile(r"[ \t\r\n]*")
_OTHER = re.compile(r"[-+\w.]+|.", re.DOTALL)
_COMMENTS = ("//", "/*", "#")
_CLOSING = {"{": "}", "[": "]"}
_PYTHON = {"None": "null", "True": "true", "False": "false", "nan": "a number"}
_NUMBER = re.compile(r"(?P<sign>[-+]?)(?=\.?[0-9])(?P<whole>[0-9]*)(?P<fraction>\.[0-9]*)?")
_SHOWN = 30


@dataclass(frozen=True)
class Slip:
    """A mistake; ``at`` is its place in the text, from 0."""

    at: int
    what: str
    hint: str


class _Found(Exception):
    """Carries a Slip."""


class JsonError(ValueError):
    """Text that is not JSON, or has a key twice: what is wrong, with line and column from 1, and what to write."""

    def __init__(self, what: str, hint: str, line: int, column: int) -> None:
        super().__init__(what)
        self.what, self.hint, self.line, self.column = what, hint, line, column


class _Twice(ValueError):
    """An object has a key twice."""


def loads(text: str) -> Any:
    """The JSON of a text; raises JsonError, RecursionError, and ValueError for a number of too many digits."""
    try:
        return json.loads(text, object_pairs_hook=_once)
    except (json.JSONDecodeError, _Twice) as error:
        slip = slip_in(text) or Slip(getattr(error, "pos", 0), f"not JSON: {error}", "")
        line = text.count("\n", 0, slip.at) + 1
        raise JsonError(slip.what, slip.hint, line, slip.at - text.rfind("\n", 0, slip.at)) from error


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise _Twice
    return found


def slip_in(text: str) -> Slip | None:
    """The first mistake in a text that should be JSON; of equal keys in an object the second is one, too."""
    try:
        _Reading(text).document()
    except _Found as found:
        slip: Slip = found.args[0]
        return slip
    return None


def _as_json(number: re.Match[str]) -> str:
    """A number as JSON has it: with digits before and behind its point, and no other zero or sign before it."""
    whole = number["whole"].lstrip("0") or "0"
    fraction = number["fraction"] or ""
    return f"{number['sign'].strip('+')}{whole}{fraction}{'0' if fraction == '.' else ''}"


class _Reading:
    """The text from ``at``, and what is open there: brackets with their places, and keys of objects."""

    def __init__(self, text: str) -> None:
        self.text, self.at, self.end = text, 0, 0
        self.open: list[tuple[str, int, set[str]]] = []

    def document(self) -> None:
        self._skip()
        if self.at == len(self.text):
            self._fail("the file is empty, expected JSON", "an object begins with { and ends with }", 0)
        wants_value, behind_comma = True, -1
        while wants_value or self.open:
            if wants_value:
                wants_value, behind_comma = self._value(behind_comma), -1
            else:
                wants_value, behind_comma = self._behind()
        self._skip()
        if self.at < len(self.text):
            self._comment()
            self._fail(f"'{self._shown()}' follows the end of the JSON", "remove it, or the bracket too many before it")

    def _value(self, comma: int) -> bool:
        """Reads the begin of an entry; whether its value follows within."""
        self._skip()
        inside = self.open[-1][0] if self.open else ""
        if self._sign() in ("}", "]") and inside:
            if comma >= 0:
                self._fail(f"a comma before the closing '{self._sign()}'", "remove it: JSON has none there", comma)
            self._close()
            return False
        if inside == "{":
            self._key()
        if (sign := self._sign()) in _CLOSING:
            self.open.append((sign, self.at, set()))
            self._step(1)
            return True
        self._scalar()
        return False

    def _behind(self) -> tuple[bool, int]:
        """Reads what is behind a value: whether another follows, and where its comma is."""
        self._skip()
        sign, bracket = self._sign(), self.open[-1][0]
        if sign == ",":
            self._step(1)
            return True, self.at - 1
        if sign in ("}", "]"):
            self._close()
            return False, -1
        self._ended()
        self._comment()
        if sign == ":":
            self._fail("a colon that no key is before", f"'{bracket}' opens a list: write {{...}} for keys with values")
        if self.text.count("\n", self.end, self.at) == 0 and re.match(r"[A-Za-z%°]", self._rest()):
            hint = "remove it: JSON has numbers without units, and other text in quotes"
            self._fail(f"'{self._shown()}' behind a value", hint)
        return self._fail("a comma is missing behind this value", "write ',' here", max(self.end - 1, 0))

    def _key(self) -> None:
        begin = self.at
        match = _TOKEN.match(self.text, self.at)
        if match is None or not match["string"]:
            self._ended()
            self._quotes()
            self._comment()
            if self._sign() == ",":
                self._fail("a comma where a key is expected", "remove it")
            word = self._shown()
            self._fail(f"'{word}' is no key, which is a text in double quotes", f'write "{word}": and its value')
        name, keys = match["string"], self.open[-1][2]
        self._step(len(name))
        if name in keys:
            self._fail(
                f"the key {name} appears twice in one object", "keep one of them: only the last would count", begin
            )
        keys.add(name)
        self._skip()
        if self._sign() != ":":
            self._ended()
            if ":" in name:
                self._fail("this quotation mark is not closed before the colon", 'write " at the end of the key', begin)
            hint = f"write {name}: and its value"
            self._fail(f"':' is missing behind the key {name}", hint, self.end - 1)
        self._step(1)
        self._skip()

    def _scalar(self) -> None:
        match = _TOKEN.match(self.text, self.at)
        if match and not match["sign"]:
            self._step(len(match[0]))
            return
        self._ended()
        self._quotes()
        self._comment()
        sign, word = self._sign(), self._shown()
        if sign in (",", ":", "}", "]"):
            self._fail(f"a value is missing before '{sign}'", "write it, or remove what is too many")
        if word in _PYTHON:
            self._fail(f"'{word}' is Python, not JSON", f"write {_PYTHON[word]}")
        if number := _NUMBER.fullmatch(word):
            self._fail(f"'{word}' is not a number of JSON", f"write {_as_json(number)}")
        if not self.open:
            self._fail(f"not JSON, which begins with {{ or [: '{word}'", "")
        self._fail(f"'{word}' is not a value of JSON", "write a text in double quotes")

    def _close(self) -> None:
        sign, (bracket, place, _) = self._sign(), self.open[-1]
        if sign != _CLOSING[bracket]:
            line = self.text.count("\n", 0, place) + 1
            what = f"'{sign}' does not close '{bracket}' of line {line}"
            self._fail(what, f"write '{_CLOSING[bracket]}' before it, or remove '{sign}' if it is too many")
        self.open.pop()
        self._step(1)

    def _ended(self) -> None:
        """Fails at the end of the text, for the bracket that is open."""
        if self.at < len(self.text):
            return
        if self.open:
            bracket, place, _ = self.open[-1]
            self._fail(f"'{bracket}' is not closed", f"write '{_CLOSING[bracket]}' where it ends", place)
        self._fail("the file ends where a value is expected", "write it", max(self.end - 1, 0))

    def _quotes(self) -> None:
        """Fails at a text that is in wrong quotation marks, not closed, or has what JSON does not allow."""
        line = self._rest().partition("\n")[0]
        first = line[:1]
        if first in ("'", "`", "\u201c", "\u201e"):
            closing = re.match(r"['`\u201c\u201e]([^'`\u201c\u201d]*)['`\u201c\u201d]", line)
            is_plain = closing and len(closing[1]) <= _SHOWN and not re.search(r'["\\\x00-\x1f]', closing[1])
            hint = f'write "{closing[1]}"' if closing and is_plain else 'write "..."'
            self._fail("other quotation marks than JSON has", hint)
        if first != '"':
            return
        part = re.match(r'"(?:[^"\\\x00-\x1f]|\\(?:["\\/bfnrt]|u[0-9A-Fa-f]{4}))*', line)
        end = part.end() if part else 1
        if line[end : end + 1] == "\\":
            hint = r"write \\ for a backslash, or / in a path"
            self._fail(f"'{line[end : end + 2]}' means nothing in JSON", hint, self.at + end)
        if line[end:].strip("\r"):
            self._fail("a tab or another control character within a text", "write \\t, or a space", self.at + end)
        self._fail("this quotation mark is not closed in its line", 'write " at the end of the text')

    def _comment(self) -> None:
        if self._rest().startswith(_COMMENTS):
            self._fail("a comment, which JSON does not have", "remove it")

    def _sign(self) -> str:
        return self.text[self.at : self.at + 1]

    def _rest(self) -> str:
        return self.text[self.at : self.at + (1 << 16)]

    def _shown(self) -> str:
        match = _OTHER.match(self.text, self.at)
        return match[0][:_SHOWN] if match else ""

    def _step(self, length: int) -> None:
        self.at += length
        self.end = self.at

    def _skip(self) -> None:
        match = _BLANK.match(self.text, self.at)
        self.at = match.end() if match else self.at

    def _fail(self, what: str, hint: str, at: int = -1) -> NoReturn:
        raise _Found(Slip(self.at if at < 0 else at, what, hint))
