"""JSON values that know their file and path, so that every error names its place."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, Self

MAX_BYTES = 64 * 1024 * 1024
MAX_NUMBER = 100_000.0


class MapError(ValueError):
    """A map that cannot be used: one sentence that names file, place and what was expected."""


def read_bytes(path: Path) -> bytes:
    """The contents of a regular file of at most 64 MiB; MapError otherwise."""
    if not path.exists():
        raise MapError(f"there is no file '{path}'")
    if not path.is_file():
        raise MapError(f"{path}: not a regular file")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise MapError(f"{path}: the file has {size} bytes, expected at most {MAX_BYTES}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise MapError(f"{path}: the file cannot be read: {error.strerror}") from error


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


@dataclass(frozen=True)
class Node:
    """A value, the file that it is from and its JSON path, as in ``$.model[0].color``."""

    file: Path
    place: str
    value: object

    @classmethod
    def load(cls, file: Path) -> Self:
        try:
            return cls(file, "$", json.loads(read_bytes(file).decode("utf-8-sig")))
        except json.JSONDecodeError as error:
            raise MapError(f"{file}:{error.lineno}:{error.colno}: not JSON: {error.msg}") from error
        except UnicodeDecodeError as error:
            raise MapError(f"{file}: byte {error.start} is not UTF-8 text") from error
        except RecursionError as error:
            raise MapError(f"{file}: the JSON is nested too deeply") from error

    def fail(self, expected: str) -> NoReturn:
        raise MapError(f"{self.file}: {self.place}: expected {expected}, found {_shown(self.value)}")

    def member(self, key: str) -> "Node | None":
        if not isinstance(self.value, dict):
            self.fail("an object")
        return Node(self.file, f"{self.place}.{key}", self.value[key]) if key in self.value else None

    def required(self, key: str) -> "Node":
        node = self.member(key)
        return node if node is not None else self.lacks(f"'{key}'")

    def lacks(self, what: str) -> NoReturn:
        raise MapError(f"{self.file}: {self.place}: {what} is missing")

    def items(self, key: str) -> Iterator["Node"]:
        """The elements of the list ``key``; none when there is no such list."""
        node = self.member(key)
        values = [] if node is None else node.value
        if node is not None and not isinstance(values, list):
            node.fail("a list")
        for index, value in enumerate(values):  # type: ignore[arg-type, var-annotated]
            yield Node(self.file, f"{self.place}.{key}[{index}]", value)

    def text(self) -> str:
        if not isinstance(self.value, str) or not self.value:
            self.fail("a string that is not empty")
        return self.value

    def numbers(self, names: str) -> tuple[float, ...]:
        """A list of as many numbers as there are names, each at most 100 000 either way."""
        wanted = names.split()
        if not isinstance(self.value, list) or len(self.value) != len(wanted):
            self.fail(f"the numbers [{', '.join(wanted)}]")
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
            self.fail(f"a file inside the map's folder {folder}")
        if not path.is_file():
            self.fail(f"a file in {folder}")
        return path
