"""Leases between users, and records that are damaged or cannot be written."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.run import leases
from tests.run.desk import ROOT

ASKS_AS_NOBODY = """
import os
from dodo_dsl.run import leases
if os.getuid() == 0:
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
print(leases.holder("cid-121"))
"""


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A lease folder that every user can read."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        monkeypatch.setenv("DODO_LEASES", name)
        yield Path(name)


def ask_as_nobody(folder: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DODO_LEASES": str(folder)}
    command = [sys.executable, "-c", ASKS_AS_NOBODY]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_another_users_process_is_named(folder: Path) -> None:
    """Process 1 is nobody's to signal, and lives."""
    (folder / "cid-121.1.json").write_text(json.dumps({"pid": 1, "test": "theirs"}))
    assert ask_as_nobody(folder) == "test theirs of process 1"


def test_another_users_record_that_cannot_be_read_names_nobody(folder: Path) -> None:
    (folder / "cid-121.1.json").write_text(json.dumps({"pid": 1, "test": "theirs"}))
    (folder / "cid-121.1.json").chmod(0o000)
    assert ask_as_nobody(folder) == "another process"


@pytest.mark.parametrize("text", ["", "[]", "3", '{"pid": 1e400}', '{"pid": 9999999999999999999999}', "[" * 100_000])
def test_damaged_records_name_nobody_and_are_removed(folder: Path, text: str) -> None:
    (folder / "cid-121.1.json").write_text(text)
    leases.forget_dead()
    assert leases.holder("cid-121") == "another process"
    for lease, about in leases.orphans("cid-"):
        assert isinstance(about, dict)
        lease.release()
    assert list(folder.glob("*.json")) == []


def test_lease_whose_record_cannot_be_written_is_not_held(folder: Path) -> None:
    record = folder / f"cid-121.{os.getpid()}.json"
    record.mkdir()
    with pytest.raises(OSError, match="Is a directory"):
        leases.try_lease("cid-121", {})
    record.rmdir()
    lease = leases.try_lease("cid-121", {})
    assert lease is not None
    lease.release()
