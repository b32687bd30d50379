"""JSON values that know their file and path, so that every error names its position."""

import difflib
import functools
import json
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Self

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.problem import InputError

MAX_NUMBER = 100_000.0
_EXPECTED = {
    "Expecting ','": "a comma or a closing bracket",
    "Expecting ':'": "':' behind the key",
    "Expecting property": "a key in double quotes",
    "Extra data": "nothing more, as the JSON ends before",
    "Unterminated": 'a text that ends with " in its line',
    "Invalid control": "a text without tabs and line breaks",
    "Invalid \\": "\\\\ for a backslash, or / in a path",
}
"""What to say for how Python's sentences begin."""
_VALUE = "a value: a text in double quotes, a number such as -0.5, true, false, null, [...] or {...}"
_SHOWN = 30


class _Twice(dict[str, Any]):
    """An object that has a key twice, and the key."""

    key = ""


def read_bytes(path: Path) -> bytes:
    """The contents of a regular file of at most 64 MiB; raises InputError."""
    try:
        return regular_file.content(path)
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from None


def loads(file: Path, text: str) -> Any:
    """The JSON of a file's text; raises InputError."""
    is_doubtful = False

    def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
        nonlocal is_doubtful
        if len(found := dict(pairs)) < len(pairs):
            is_doubtful, found = True, _Twice(found)
            names = [name for name, _ in pairs]
            found.key = next(name for at, name in enumerate(names) if name in names[:at])
        return found

    try:
        value = json.loads(text, object_pairs_hook=once)
        place = next(_repeated(value, "$"), "") if is_doubtful else ""
    except json.JSONDecodeError as error:
        raise _refused(file, text, error) from None
    except RecursionError:
        raise InputError(file, "the JSON is nested too deeply") from None
    except ValueError:
        raise InputError(file, f"a number has more than {sys.get_int_max_str_digits()} digits") from None
    if place:
        what = f"the key '{place.rpartition('.')[2]}' appears twice in one object"
        raise InputError(file, what, place, hint="keep one of them: only the last would count", is_of_key=True)
    return value


def _repeated(value: Any, place: str) -> Iterator[str]:
    """The paths of keys that stand twice in their objects."""
    if isinstance(value, _Twice):
        yield f"{place}.{value.key}"
    for step, inner in value.items() if isinstance(value, dict) else ():
        yield from _repeated(inner, f"{place}.{step}")
    for number, inner in enumerate(value if isinstance(value, list) else ()):
        yield from _repeated(inner, f"{place}[{number}]")


def _refused(file: Path, text: str, error: json.JSONDecodeError) -> InputError:
    before, at = text[: error.pos].rstrip(), error.pos
    expected, hint = next((said for begin, said in _EXPECTED.items() if error.msg.startswith(begin)), _VALUE), ""
    if text[at : at + 1] in "]}" and before.endswith(","):
        at = len(before) - 1
    if text[at : at + 1] == "," and text[at + 1 :].lstrip()[:1] in "]}":
        expected, hint = "a closing bracket", "remove the comma: JSON has none there"
    word = re.match(r"[-+.\w]+|.", text[at:].lstrip()[:_SHOWN], re.DOTALL)
    found = f"'{word[0]}'" if word else "the end of the file"
    line, column = text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)
    return InputError(file, f"not JSON: expected {expected}, found {found}", line=line, column=column, hint=hint)


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


def near(word: str, known: Iterable[str]) -> str:
    """A hint that names the known word that is spelt alike; empty if there is none."""
    close = difflib.get_close_matches(word, sorted(known), n=1, cutoff=0.7)
    return f"did you mean '{close[0]}'?" if close else ""


@functools.lru_cache(maxsize=2)
def _document(file: Path, data: bytes) -> object:
    """The JSON in a file, which several readers may look at one after the other; none of them changes it."""
    try:
        return loads(file, data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(file, f"byte {error.start} is not UTF-8 text", line=line) from None


@dataclass(frozen=True)
class Node:
    """A value, the file that it is from and its JSON path, as in ``$.model[0].color``."""

    file: Path
    place: str
    value: Any

    @classmethod
    def load(cls, file: Path) -> Self:
        """The whole document; raises InputError."""
        return cls(file, "$", _document(file, read_bytes(file)))

    def fail(self, expected: str, hint: str = "") -> NoReturn:
        raise InputError(self.file, f"expected {expected}, found {_shown(self.value)}", self.place, hint=hint)

    def member(self, key: str) -> "Node | None":
        if not isinstance(self.value, dict):
            self.fail("an object")
        return Node(self.file, f"{self.place}.{key}", self.value[key]) if key in self.value else None

    def required(self, key: str) -> "Node":
        node = self.member(key)
        return node if node is not None else self.lacks(f"'{key}'")

    def lacks(self, what: str) -> NoReturn:
        raise InputError(self.file, f"{what} is missing", self.place)

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
        """The file that this names; InputError when it is not there or outside the map's folder."""
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


def unread(entries: Iterable[Node], known: Collection[str], needed: Collection[str] = ()) -> Iterator[InputError]:
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
        what = f"nothing reads '{key}'" + (f" (and in {len(those) - 1} more)" if len(those) > 1 else "")
        hint = hint or f"known: {', '.join(known)}"
        yield InputError(those[0].file, what, f"{those[0].place}.{key}", hint=hint, is_slip=is_slip, is_of_key=True)
