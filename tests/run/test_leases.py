"""Leases: held, shared, waited for, left to others, and with records that are damaged or another user's."""

import asyncio
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.run import leases
from dodo_dsl.run.leases import Lease, LeaseTimeout
from tests.run.desk import ROOT
from tests.run.scripted import run

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


def take(name: str, shared: bool = False) -> Lease:
    lease = leases.try_lease(name, {"test": "mine"}, shared)
    assert lease is not None
    return lease


def test_a_lease_excludes_others_until_it_is_released(folder: Path) -> None:
    held = take("cid-121")
    assert leases.try_lease("cid-121", {}) is None
    assert leases.holder("cid-121") == f"test mine of process {os.getpid()}"
    held.release()
    assert leases.holder("cid-121") == "another process"
    take("cid-121").release()
    assert [path.name for path in folder.iterdir()] == ["cid-121.lock"]


def test_shared_leases_exclude_only_exclusive_ones(folder: Path) -> None:
    first, second = take("machine", shared=True), take("machine", shared=True)
    assert leases.try_lease("machine", {}) is None
    first.release()
    assert leases.try_lease("machine", {}) is None
    second.release()
    held = take("machine")
    assert leases.try_lease("machine", {}, shared=True) is None
    held.release()


def test_a_lease_of_a_random_name_leaves_no_file(folder: Path) -> None:
    take("run-abc").release()
    assert list(folder.iterdir()) == []


def test_what_was_left_belongs_to_those_who_inherited_it_and_then_to_nobody(folder: Path) -> None:
    held = take("cid-121")
    inherited = os.dup(held.descriptor)
    held.leave()
    assert list(leases.orphans("cid-")) == []
    os.close(inherited)
    ((orphan, about),) = leases.orphans("cid-")
    assert (orphan.name, about) == ("cid-121", {"pid": os.getpid(), "test": "mine"})
    assert leases.try_lease("cid-121", {}) is None, "an orphan is yielded held"
    orphan.release()
    assert list(leases.orphans("cid-")) == []


def wait(names: list[str], *releases: tuple[float, Lease], patience_s: float = 600.0) -> tuple[str, float, list[str]]:
    """The lease that came free, when, and what was said; the given leases are released at these times."""
    said: list[str] = []

    async def scene() -> tuple[str, float]:
        loop = asyncio.get_running_loop()
        for seconds, lease in releases:
            loop.call_later(seconds, lease.release)
        found = await leases.lease_any(names, {"test": "waits"}, said.append, patience_s=patience_s)
        found.release()
        return found.name, loop.time()

    return *run(scene()), said


def test_the_first_free_lease_is_taken_at_once(folder: Path) -> None:
    held = take("cid-121")
    assert wait(["cid-121", "cid-122"]) == ("cid-122", 0.0, [])
    held.release()


def test_a_busy_lease_is_waited_for_and_its_holder_named_once(folder: Path) -> None:
    name, when, said = wait(["cid-121", "cid-122"], (30.0, take("cid-121")), (20.0, take("cid-122")))
    assert (name, said) == ("cid-122", [f"waiting for test mine of process {os.getpid()}"])
    assert when == pytest.approx(20.0, abs=0.5)


def test_waiting_has_a_limit(folder: Path) -> None:
    held = take("cid-121")
    with pytest.raises(LeaseTimeout) as caught:
        wait(["cid-121"], patience_s=60.0)
    holder = f"test mine of process {os.getpid()}"
    assert str(caught.value) == f"no cid came free within 60 s; {holder} holds one"
    held.release()


def test_records_of_dead_processes_are_forgotten(folder: Path) -> None:
    """The largest number of a process that a kernel may be set to, and this very process."""
    for pid in (1 << 22, os.getpid()):
        (folder / f"machine.{pid}.json").write_text(json.dumps({"pid": pid}))
    leases.forget_dead()
    assert [path.name for path in folder.iterdir()] == [f"machine.{os.getpid()}.json"]
