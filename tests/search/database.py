"""A PostgreSQL server of a test's own, in a temporary folder, reached by a Unix socket and by nothing else."""

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

_USER = "nobody"
"""Runs the server where root runs the tests, as PostgreSQL refuses root."""
_RULES = "local all locked scram-sha-256\nlocal all all trust\n"
_LOCKED = "create role locked login password 'se/c@ret'"


def _programs() -> Path:
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: int(path.parent.name))
    if folders:
        return folders[-1]
    found = shutil.which("initdb")
    return Path(found).parent if found else pytest.skip("PostgreSQL is not installed")


class Database:
    """``address`` has no password; the role ``locked`` has one, se/c@ret."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._programs = folder, _programs()
        self.user = _USER if os.geteuid() == 0 else pwd.getpwuid(os.geteuid()).pw_name
        self.address = self.address_of(self.user)

    def address_of(self, user: str, database: str = "postgres") -> str:
        return f"postgresql://{user}@{str(self.folder).replace('/', '%2F')}/{database}"

    def start(self) -> None:
        if os.geteuid() == 0:
            shutil.chown(self.folder, _USER)
        data = self.folder / "data"
        self._do("initdb", "--no-sync", "--auth=trust", "--encoding=UTF8", "--locale=C", "-D", data)
        (data / "pg_hba.conf").write_text(_RULES)
        with (data / "postgresql.conf").open("a") as settings:
            settings.write(f"listen_addresses = ''\nunix_socket_directories = '{self.folder}'\nfsync = off\n")
        self._do("pg_ctl", "-w", "-D", data, "-l", self.folder / "log", "start")
        self.sql(_LOCKED)

    def stop(self) -> None:
        self._do("pg_ctl", "-D", self.folder / "data", "-m", "immediate", "stop")

    def sql(self, statement: str) -> list[list[str]]:
        """The rows of an answer, as texts."""
        words = ("-X", "-q", "-A", "-t", "-F", "\t", "-c", statement, self.address)
        return [line.split("\t") for line in self._do("psql", *words).splitlines()]

    def _do(self, program: str, *words: object) -> str:
        user = _USER if os.geteuid() == 0 else None
        group = pwd.getpwnam(_USER).pw_gid if user else None
        # a file, as the server inherits the output of what starts it, and a pipe would stay open
        with tempfile.TemporaryFile("w+") as output:
            result = subprocess.run(
                [self._programs / program, *map(str, words)], stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, cwd=self.folder, user=user, group=group,
                extra_groups=[] if user else None, timeout=60, check=False,
            )  # fmt: skip
            output.seek(0)
            said = output.read()
        assert result.returncode == 0, said
        return said


def served() -> Iterator[Database]:
    """A server that runs as long as this; skips the test where PostgreSQL or psycopg is missing."""
    pytest.importorskip("psycopg")
    _programs()
    folder = Path(tempfile.mkdtemp(prefix="dodo-postgres-"))
    database = Database(folder)
    try:
        database.start()
        yield database
    finally:
        if (folder / "data" / "postmaster.pid").exists():
            database.stop()
        shutil.rmtree(folder)
