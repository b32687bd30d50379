"""The drives of a search by their values: none is driven twice, whatever ends the command. Here in a SQLite file."""

import contextlib
import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

FILE_NAME = "search.sqlite"
_TABLES = """
create table if not exists study (key text not null);
create table if not exists drives (
    point text primary key, number integer not null, outcome text not null, margin real, reason text not null,
    checks text not null default ''
);
"""
_LATER = "alter table drives add column checks text not null default ''"
"""For a file of before; it was written by a version that did not keep it."""


class OtherSearch(Exception):
    """The file holds what cannot be continued."""

    usage = True


@dataclass(frozen=True)
class Drive:
    """What became of a test at some values; ``number`` counts drives in the order in which they were asked for.

    ``margin`` is the least of its checks, from -1 to 1, negative if it failed; None for an error. ``checks`` are the
    names of those that failed, with commas.
    """

    number: int
    values: Mapping[str, str]
    outcome: str
    margin: float | None
    reason: str
    checks: str = ""


class Store(Protocol):
    """The drives of one study: the same test, ranges and seed.

    If it ``is_shared``, several workers drive, and each claims values before it drives there.
    """

    is_shared: bool

    def get(self, values: Mapping[str, str]) -> Drive | None: ...

    def known(self, points: Sequence[Mapping[str, str]]) -> Sequence[Drive | None]:
        """What ``get`` says of each, asked for at once."""

    def claim(self, values: Mapping[str, str]) -> bool:
        """Whether this worker is to drive at these values: no other does, or has done."""

    def add(self, drive: Drive) -> None:
        """Keeps a drive and ends its claim; the first one at some values stays."""

    def wait(self) -> None:
        """Returns when others may have got on."""


class FileStore:
    """A file, which one worker uses at a time. Raises OtherSearch for that of another study."""

    is_shared = False

    def __init__(self, folder: Path, key: str, name: str = FILE_NAME) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / name
        try:
            self._connection = sqlite3.connect(self._path)
            self._connection.executescript(_TABLES)
            if "checks" not in {row[1] for row in self._connection.execute("pragma table_info(drives)")}:
                self._connection.execute(_LATER)
            found = self._connection.execute("select key from study").fetchone()
        except sqlite3.Error as error:
            raise OtherSearch(f"'{self._path}' cannot be used: {error}") from error
        if found is None:
            with self._connection:
                self._connection.execute("insert into study values (?)", (key,))
        elif found[0] != key:
            raise OtherSearch(
                f"'{self._path}' is of another test, application, range or seed: name another folder with --report, "
                "or remove it"
            )

    def add(self, drive: Drive) -> None:
        with self._told(), self._connection:
            self._connection.execute(
                "insert or ignore into drives values (?, ?, ?, ?, ?, ?)",
                (point_text(drive.values), drive.number, drive.outcome, drive.margin, drive.reason, drive.checks),
            )

    def get(self, values: Mapping[str, str]) -> Drive | None:
        columns = "number, outcome, margin, reason, checks"
        with self._told():
            found = self._connection.execute(f"select {columns} from drives where point = ?", (point_text(values),))  # noqa: S608
            row = found.fetchone()
        return Drive(row[0], dict(values), *row[1:]) if row else None

    def known(self, points: Sequence[Mapping[str, str]]) -> Sequence[Drive | None]:
        return [self.get(values) for values in points]

    def claim(self, values: Mapping[str, str]) -> bool:
        """There are no others."""
        return True

    def wait(self) -> None:
        """There is nobody to wait for."""

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        """A full disk, or a file that others lock, is an error of the file."""
        try:
            yield
        except sqlite3.Error as error:
            raise OtherSearch(f"'{self._path}' cannot be used: {error}") from error

    def close(self) -> None:
        self._connection.close()


@contextlib.contextmanager
def opened(folder: Path, key: str, name: str = FILE_NAME) -> Iterator[FileStore]:
    store = FileStore(folder, key, name)
    try:
        yield store
    finally:
        store.close()


def point_text(values: Mapping[str, str]) -> str:
    """What names a drive in a table."""
    return json.dumps(dict(sorted(values.items())), ensure_ascii=False)
