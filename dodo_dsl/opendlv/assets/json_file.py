"""JSON values that know their file and path, so that every error names its position.

What is wrong with text that is not JSON is in our own words: a table of the mistakes that people make.
"""

import difflib
import functools
import json
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Self

from dodo_dsl.opendlv.assets.problem import InputError, place_of_key

_TOKEN = re.compile(r'"(?:[^"\\\n]++|\\.)*+"|[][{}]')
_CLOSING = {"{": "}", "[": "]"}
_NEAR = 2000
"""Characters before and behind the position where Python's reader gives up that are looked at."""
_SHOWN = 30
_VALUES = "a value is a text in double quotes, a number, true, false, null, [...] or {...}"
_SLIPS = (
    (r"(?P<at>,)\s*\0(?P<sign>[]}])", "a comma before the closing '{sign}'", "remove it: JSON has none there"),
    (r"\0(?P<at>,)\s*(?P<sign>[]}])", "a comma before the closing '{sign}'", "remove it: JSON has none there"),
    (r"\0(?://|/\*|#)", "a comment, which JSON does not have", "remove it"),
    (r"\0['`\u201c\u201e]", "other quotation marks than JSON has", 'write "..."'),
    (r"\0(?P<at>\\.)", "'{at}' means nothing in JSON", "write \\\\ for a backslash, or / in a path"),
    (
        r'\0"(?:[^"\\\n]|\\.)*(?:\n|$)',
        "this quotation mark is not closed in its line",
        'write " at the end of the text',
    ),
    (r"\0[\x01-\x1f]", "a tab or another control character within a text", "write \\t, or a space"),
    (
        r"[{,]\s*\0(?P<at>[A-Za-z_][\w.-]*)",
        "'{at}' is not a key, which is a text in double quotes",
        'write "{at}": and its value',
    ),
    (r"\0(?P<at>None|True|False)\b", "'{at}' is Python, not JSON", "write null, true or false"),
    (
        r'\{(?:[^{}]*,)?\s*"(?:[^"\\\n]|\\.)*(?P<at>")\s*\0[^:]',
        "':' is missing behind this key",
        "write ':' and its value",
    ),
    (r'(?P<at>[]}"])\s*\0[-"[{0-9tfn]', "a comma is missing behind this value", "write ',' here"),
    (r'(?P<at>[0-9a-z])\s+\0[-"[{0-9tfn]', "a comma is missing behind this value", "write ',' here"),
    (
        r"(?<![\w.])(?P<at>-?[0-9]*\0[-+]?[0-9]*\.?[0-9]*)(?<=[\d.])",
        "'{at}' is not a number of JSON",
        "write digits before and behind the point, as in 0.5, and no other zero or plus before them",
    ),
    (
        r"[0-9] *\0(?P<at>[A-Za-z%\u00b0/]+)",
        "'{at}' behind a value",
        "remove it: JSON has numbers without units, and other text in quotes",
    ),
)
"""Patterns of the text around that position, which is marked in it, with what to say about their group ``at``."""


class JsonError(ValueError):
    """Text that is not JSON, or has a key twice: what is wrong, with line and column from 1, and what to write."""

    def __init__(self, what: str, hint: str, line: int, column: int) -> None:
        super().__init__(what)
        self.what, self.hint, self.line, self.column = what, hint, line, column


class _Slip(NamedTuple):
    """A mistake; ``at`` is its position in the text, from 0."""

    at: int
    what: str
    hint: str = ""


class _Twice(ValueError):
    """An object has this key twice."""


def loads(text: str) -> Any:
    """The JSON of a text; raises JsonError, RecursionError, and ValueError for a number of too many digits."""
    ended = 0

    def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
        nonlocal ended
        ended += 1
        if len(found := dict(pairs)) < len(pairs):
            names = [name for name, _ in pairs]
            raise _Twice(next(name for at, name in enumerate(names) if name in names[:at]))
        return found

    try:
        return json.loads(text, object_pairs_hook=once)
    except json.JSONDecodeError as error:
        slip = _slip(text, error.pos)
    except _Twice as twice:
        slip = _second(text, ended, str(twice))
    line = text.count("\n", 0, slip.at) + 1
    raise JsonError(slip.what, slip.hint, line, slip.at - text.rfind("\n", 0, slip.at))


def _second(text: str, number: int, name: str) -> _Slip:
    """The key that the object has twice which is the one to end as this ``number``, counted from 1."""
    begin = _brackets(text)[1][number - 1]
    what = f"the key {json.dumps(name, ensure_ascii=False)} appears twice in one object"
    return _Slip(place_of_key(text, begin, name), what, "keep one of them: only the last would count")


def _brackets(text: str) -> tuple[list[int], list[int]]:
    """Where brackets begin that are not closed, and where objects do that are, in the order in which they end."""
    open_, objects = list[int](), list[int]()
    for token in _TOKEN.finditer(text):
        if token[0] in _CLOSING:
            open_.append(token.start())
        elif token[0] in "]}" and open_:
            begin = open_.pop()
            objects.extend([begin] if text[begin] == "{" else [])
    return open_, objects


def _slip(text: str, at: int) -> _Slip:
    if not text.strip():
        return _Slip(0, "the file is empty, expected JSON", "an object begins with { and ends with }")
    begin = max(0, at - _NEAR)
    near = f"{text[begin:at]}\0{text[at : at + _NEAR]}"
    for pattern, what, hint in _SLIPS:
        if found := re.search(pattern, near):
            place = found.start("at") if "at" in found.groupdict() else found.start() + found[0].index("\0") + 1
            words = {name: word.replace("\0", "")[:_SHOWN] for name, word in found.groupdict().items()}
            return _Slip(begin + place - near.count("\0", 0, place), what.format(**words), hint.format(**words))
    if slip := _of_brackets(text, at):
        return slip
    word = re.match(r"[-+.\w]+|.|$", text[at : at + _SHOWN], re.DOTALL)
    return _Slip(at, f"not JSON: '{word[0] if word else ''}' is not expected here", _VALUES)


def _of_brackets(text: str, at: int) -> _Slip | None:
    open_, sign = _brackets(text[:at])[0], text[at : at + 1]
    if open_ and not text[at:].strip():
        bracket = text[open_[-1]]
        return _Slip(open_[-1], f"'{bracket}' is not closed", f"write '{_CLOSING[bracket]}' where it ends")
    if open_ and sign in ("}", "]") and sign != (closing := _CLOSING[text[open_[-1]]]):
        what = f"'{sign}' does not close '{text[open_[-1]]}' of line {text.count(chr(10), 0, open_[-1]) + 1}"
        return _Slip(at, what, f"write '{closing}' before it, or remove '{sign}' if it is too many")
    if not open_ and text[:at].strip():
        return _Slip(at, f"'{sign}' follows the end of the JSON", "remove it, or the bracket too many before it")
    return None


MAX_BYTES = 64 * 1024 * 1024
MAX_NUMBER = 100_000.0


class MapError(InputError):
    """A map that cannot be used."""


def read_bytes(path: Path) -> bytes:
    """The contents of a regular file of at most 64 MiB; MapError otherwise."""
    if not path.exists():
        raise MapError(path, "there is no such file", sentence=f"there is no file '{path}'")
    if not path.is_file():
        raise MapError(path, "not a regular file")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise MapError(path, f"the file has {size} bytes, expected at most {MAX_BYTES}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise MapError(path, f"the file cannot be read: {error.strerror}") from error


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


def near(word: str, known: Iterable[str]) -> str:
    """A hint that names the known word that is spelt alike; empty if there is none."""
    close = difflib.get_close_matches(word, sorted(known), n=1, cutoff=0.7)
    return f"did you mean '{close[0]}'?" if close else ""


@functools.lru_cache(maxsize=2)
def _document(data: bytes) -> object:
    """The JSON in a file, which several readers may look at one after the other; none of them changes it."""
    return loads(data.decode("utf-8-sig"))


def forget() -> None:
    """Keep no document in memory."""
    _document.cache_clear()


@dataclass(frozen=True)
class Node:
    """A value, the file that it is from and its JSON path, as in ``$.model[0].color``."""

    file: Path
    place: str
    value: Any

    @classmethod
    def load(cls, file: Path) -> Self:
        data = read_bytes(file)
        try:
            return cls(file, "$", _document(data))
        except JsonError as error:
            raise MapError(file, error.what, line=error.line, column=error.column, hint=error.hint) from error
        except UnicodeDecodeError as error:
            raise MapError(
                file, "not UTF-8 text", line=_line(error), sentence=f"{file}: byte {error.start} is not UTF-8 text"
            ) from error
        except RecursionError as error:
            raise MapError(file, "the JSON is nested too deeply") from error
        except ValueError as error:
            most = sys.get_int_max_str_digits()
            is_long = "integer string conversion" in str(error)
            what = f"a number has more than {most} digits" if is_long else f"not JSON: {str(error)[:120]}"
            raise MapError(file, what) from error

    def fail(self, expected: str, hint: str = "") -> NoReturn:
        raise MapError(self.file, f"expected {expected}, found {_shown(self.value)}", self.place, hint=hint)

    def member(self, key: str) -> "Node | None":
        if not isinstance(self.value, dict):
            self.fail("an object")
        return Node(self.file, f"{self.place}.{key}", self.value[key]) if key in self.value else None

    def required(self, key: str) -> "Node":
        node = self.member(key)
        return node if node is not None else self.lacks(f"'{key}'")

    def lacks(self, what: str) -> NoReturn:
        raise MapError(self.file, f"{what} is missing", self.place)

    def items(self, key: str) -> Iterator["Node"]:
        """The elements of the list ``key``; none when there is no such list."""
        node = self.member(key)
        values = [] if node is None else node.value
        if node is not None and not isinstance(values, list):
            node.fail("a list")
        for index, value in enumerate(values):
            yield Node(self.file, f"{self.place}.{key}[{index}]", value)

    def text(self) -> str:
        if not isinstance(self.value, str) or not self.value:
            self.fail("a string that is not empty")
        return self.value

    def numbers(self, names: str) -> tuple[float, ...]:
        """A list of as many numbers as there are names, each at most 100 000 either way."""
        wanted = names.split()
        if not isinstance(self.value, list) or len(self.value) != len(wanted):
            more = isinstance(self.value, list) and len(self.value) > len(wanted)
            self.fail(f"the numbers [{', '.join(wanted)}]", "decimals have a point: 0.25, and not 0,25" if more else "")
        return tuple(self._number(f"{self.place}[{i}]", v) for i, v in enumerate(self.value))

    def _number(self, place: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            Node(self.file, place, value).fail("a number")
        if not -MAX_NUMBER <= value <= MAX_NUMBER:
            Node(self.file, place, value).fail(f"a number between -{MAX_NUMBER:.0f} and {MAX_NUMBER:.0f}")
        return float(value)

    def resource(self) -> Path:
        """The file that this names; MapError when it is not there or outside the map's folder."""
        name, folder = self.text(), self.file.parent.resolve()
        try:
            path = (folder / name).resolve()
        except (ValueError, OSError, RuntimeError):
            self.fail("the path of a file")
        if not path.is_relative_to(folder):
            is_link = Path(os.path.normpath(folder / name)).is_relative_to(folder)
            but = ", and no symbolic link out of it" if is_link else ""
            self.fail(f"a file inside the map's folder{but}", "copy it there: the map's folder goes with the test")
        if path.exists() and not path.is_file():
            self.fail("a regular file, and no folder, FIFO or device")
        if not path.is_file():
            beside = (each.name for each in path.parent.iterdir()) if path.parent.is_dir() else ()
            self.fail("a file in the map's folder", near(path.name, beside))
        return path


def unread(entries: Iterable[Node], known: Collection[str], needed: Collection[str] = ()) -> Iterator[MapError]:
    """Keys of objects of one kind that nothing reads, each once; an error where a ``needed`` one is meant."""
    found: dict[str, list[Node]] = {}
    for entry in entries:
        for key in entry.value if isinstance(entry.value, dict) else ():
            if key not in known:
                found.setdefault(key, []).append(entry)
    for key, those in found.items():
        hint, values = near(key, known), those[0].value
        lacking = [name for name in needed if isinstance(values, dict) and name not in values]
        is_slip = not any(f"'{name}'" in hint for name in lacking)
        yield of_keys(those, key, f"nothing reads '{key}'", hint or f"known: {', '.join(known)}", is_slip)


def of_keys(entries: Sequence[Node], key: str, what: str, hint: str = "", is_slip: bool = True) -> MapError:
    """The problem of a key that these objects have, at the first."""
    more = f" (and in {len(entries) - 1} more)" if len(entries) > 1 else ""
    place = f"{entries[0].place}.{key}"
    return MapError(entries[0].file, what + more, place, hint=hint, is_slip=is_slip, is_of_key=True)


def _line(error: UnicodeDecodeError) -> int:
    """The line of the first byte that is not UTF-8."""
    return error.object.count(b"\n", 0, error.start) + 1
