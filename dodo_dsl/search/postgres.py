"""The drives of a search in a PostgreSQL database, so that any number of workers share it.

A claim is an advisory lock. It belongs to the connection, so it ends with the worker, however that ends, and another
one takes over; only the drive that was under way is lost. Neither a lease nor a clock is needed.

Source: https://www.postgresql.org/docs/current/explicit-locking.html#ADVISORY-LOCKS
"""

import contextlib
import hashlib
import os
import re
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dodo_dsl.search.store import Drive, OtherSearch, point_text

if TYPE_CHECKING:
    import psycopg

SCHEMES = ("postgresql://", "postgres://")
_PASSWORD = re.compile(r"(postgres(?:ql)?:/+[^/@:\s]*):.*@", re.DOTALL)
_PARAMETER = re.compile(r"([?&](?:ssl)?password=)[^&\s'\"]*")
MAIN = "main"
"""The name of a study if none is given."""
SECRETS = ("PGPASSWORD", "DODO_SEARCH_STORAGE")
_EXPECTED = "expected postgresql://USER@HOST/DATABASE"
_MALFORMED = (
    f"the address after --storage cannot be read, {_EXPECTED}; in a name or password, @ / : % are %40 %2F %3A %25"
)
_SETUP = 0x646F646F
"""Lock for making the tables."""
_PAUSE_S = 0.2
_ALIVE = {"keepalives_idle": 30, "keepalives_interval": 10, "keepalives_count": 3}
"""A machine that vanished is noticed within a minute, by the worker and by the server."""
_TABLES = (
    "create table dodo_study (id bigint generated always as identity primary key, name text not null, "
    "test text not null, key text not null, began timestamptz not null default now(), unique (name, test))",
    "create table dodo_drive (study bigint not null references dodo_study on delete cascade, point text not null, "
    "number integer not null, outcome text not null, margin double precision, reason text not null, "
    "worker text not null, ended timestamptz not null default now(), primary key (study, point))",
)
_LATER = "alter table dodo_drive add column if not exists checks text not null default ''"
"""The tables may have been made by a version that did not keep it; only their owner may alter them."""
_HAS_LATER = (
    "select count(*) from pg_attribute where attrelid = to_regclass('dodo_drive') and attname = 'checks' "
    "and not attisdropped"
)


def masked(text: str) -> str:
    """The text with ``***`` for each password of an address in it, also if it is written with wrong characters."""
    return _PARAMETER.sub(r"\1***", _PASSWORD.sub(r"\1:***@", text))


class StorageProblem(Exception):
    """The server cannot be reached, refuses, or went away."""


class AddressProblem(Exception):
    """An address that cannot be used; its sentence has no password."""

    usage = True


class SharedStore:
    """The drives of the study ``name`` of a test. Raises OtherSearch if its ``key`` is another one."""

    is_shared = True

    def __init__(self, address: str, name: str, test: str, key: str) -> None:
        parts = _parts(address)
        self._shown, self._worker = masked(address), socket.gethostname()
        self._password = str(parts.get("password", ""))
        self._drives: dict[str, Drive] = {}
        with self._told():
            self._connection = _connected(parts)
        try:
            with self._told():
                self._study = self._set_up(name, test, key)
        except BaseException:
            self.close()
            raise

    def _set_up(self, name: str, test: str, key: str) -> int:
        """The number of the study, which is made if it is new."""
        with self._connection.transaction():
            self._ask("select pg_advisory_xact_lock(%s)", _SETUP)
            if self._one("select to_regclass('dodo_study')") is None:
                for table in _TABLES:
                    self._ask(table)
            if self._one(_HAS_LATER) == 0:
                self._ask(_LATER)
            self._ask(
                "insert into dodo_study (name, test, key) values (%s, %s, %s) on conflict do nothing", name, test, key
            )
            ((study, found),) = self._ask("select id, key from dodo_study where (name, test) = (%s, %s)", name, test)
        if found != key:
            raise OtherSearch(
                f"the study '{name}' of {test} at {self._shown} is of another version of the test, its "
                "application, ranges or seed: name another one with --study"
            )
        return int(study)

    def get(self, values: Mapping[str, str]) -> Drive | None:
        return self.known([values])[0]

    def known(self, points: Sequence[Mapping[str, str]]) -> Sequence[Drive | None]:
        by_text = {point_text(values): values for values in points}
        if missing := [text for text in by_text if text not in self._drives]:
            columns = "point, number, outcome, margin, reason, checks"
            with self._told():
                rows = self._ask(
                    f"select {columns} from dodo_drive where study = %s and point = any(%s)",  # noqa: S608
                    self._study,
                    missing,
                )
            for text, number, *rest in rows:
                self._drives[text] = Drive(number, dict(by_text[text]), *rest)
        return [self._drives.get(point_text(values)) for values in points]

    def claim(self, values: Mapping[str, str]) -> bool:
        lock = self._lock(values)
        with self._told():
            if not self._one("select pg_try_advisory_lock(%s)", lock):
                return False
            if self.get(values) is None:
                return True
            self._ask("select pg_advisory_unlock(%s)", lock)
        return False

    def add(self, drive: Drive) -> None:
        with self._told():
            self._ask(
                "insert into dodo_drive (study, point, number, outcome, margin, reason, checks, worker) "
                "values (%s, %s, %s, %s, %s, %s, %s, %s) on conflict do nothing",
                *(self._study, point_text(drive.values), drive.number, drive.outcome, drive.margin),
                *(_storable(drive.reason), drive.checks, self._worker),
            )
            self._ask("select pg_advisory_unlock(%s)", self._lock(drive.values))

    def wait(self) -> None:
        time.sleep(_PAUSE_S)

    def close(self) -> None:
        with contextlib.suppress(Exception):
            self._connection.close()

    def _lock(self, values: Mapping[str, str]) -> int:
        digest = hashlib.sha256(f"{self._study} {point_text(values)}".encode()).digest()
        return int.from_bytes(digest[:8], signed=True)

    def _one(self, statement: str, *values: object) -> Any:
        ((value,),) = self._ask(statement, *values)
        return value

    def _ask(self, statement: str, *values: object) -> list[tuple[Any, ...]]:
        cursor = self._connection.execute(statement.encode(), values)
        return cursor.fetchall() if cursor.description else []

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        import psycopg

        try:
            yield
        except psycopg.Error as error:
            said = " ".join(str(error).split())
            if self._password:
                said = said.replace(self._password, "***")
            hint = "; a password is taken from PGPASSWORD or ~/.pgpass" if "password" in said else ""
            raise StorageProblem(f"{self._shown} cannot be used: {said}{hint}") from None


def _parts(address: str) -> dict[str, Any]:
    """What an address says; raises AddressProblem, which repeats nothing of one that is malformed."""
    import psycopg
    from psycopg.conninfo import conninfo_to_dict

    if not address.startswith(SCHEMES):
        raise AddressProblem(f"--storage takes the address of a PostgreSQL server, {_EXPECTED}")
    try:
        parts = conninfo_to_dict(address)
    except psycopg.ProgrammingError:
        raise AddressProblem(_MALFORMED) from None
    ports = str(parts.get("port", "")).replace(",", "")
    if any("@" in str(parts.get(name, "")) for name in ("host", "dbname")) or (ports and not ports.isdecimal()):
        raise AddressProblem(_MALFORMED)
    return parts


def _connected(parts: Mapping[str, Any]) -> "psycopg.Connection[tuple[Any, ...]]":
    """A connection whose statements are transactions by themselves."""
    import psycopg

    options = {"connect_timeout": 10, **_ALIVE, "application_name": "dodo search", **parts}
    connection = psycopg.connect(**options, client_encoding="utf8", autocommit=True)
    for name, value in _ALIVE.items():
        connection.execute(f"set tcp_{name} = {value:d}".encode())
    return connection


def _storable(text: str) -> str:
    """The text without what PostgreSQL does not take."""
    return text.encode(errors="replace").decode().replace("\0", "\ufffd")


@contextlib.contextmanager
def opened(address: str, name: str, test: str, key: str) -> Iterator[SharedStore]:
    """The store, as long as this lasts. The application, which inherits variables, gets none with the password."""
    store = SharedStore(address, name, test, key)
    for variable in SECRETS:
        os.environ.pop(variable, None)
    try:
        yield store
    finally:
        store.close()
