"""Leases: held, shared, waited for, left to others, and with records that are damaged or another user's."""

import asyncio
import contextlib
import fcntl
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from dodo_dsl.run import leases
from dodo_dsl.run.leases import Lease, LeaseTimeout
from tests.run.desk import ROOT
from tests.run.scripted import run


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path))
    return tmp_path


TAKES = """
import os, sys
from dodo_dsl.run import leases
os.umask(0o077)
os.setgroups([65111])
os.setresgid(*[int(sys.argv[2])] * 3)
os.setresuid(*[int(sys.argv[2])] * 3)
lease = leases.try_lease(sys.argv[1], {"test": "of " + str(os.getuid())})
print("taken" if lease else leases.holder(sys.argv[1]), flush=True)
sys.stdin.read()
"""


@pytest.mark.thorough
@pytest.mark.skipif(os.getuid() != 0, reason="only root can be two users")
def test_users_of_a_group_exclude_each_other_and_name_the_holder() -> None:
    """In a folder of root's, as an operator of rigs names it."""
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        os.chown(name, 0, 65_111)
        Path(name).chmod(0o770)
        said = []
        for user, lease in (("65001", "cid-121"), ("65002", "cid-121"), ("65002", "cid-122")):
            one = subprocess.Popen(
                [sys.executable, "-c", TAKES, lease, user], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": str(ROOT), "DODO_LEASES": name},
            )  # fmt: skip
            stack.callback(one.communicate, "")
            assert one.stdout is not None
            said.append(one.stdout.readline().strip().partition(" of process")[0])
    assert said == ["taken", "test of 65001", "taken"]


def take(name: str, shared: bool = False) -> Lease:
    lease = leases.try_lease(name, {"test": "mine"}, shared)
    assert lease is not None
    return lease


def test_a_lease_excludes_others_until_it_is_released(folder: Path) -> None:
    held = take("cid-121")
    assert leases.try_lease("cid-121", {}) is None
    assert leases.holder("cid-121") == f"test mine of process {os.getpid()}"
    held.release()
    assert leases.holder("cid-121") == ""
    take("cid-121").release()
    assert [*folder.iterdir()] == []


def test_shared_leases_exclude_only_exclusive_ones(folder: Path) -> None:
    first, second = take("machine", shared=True), take("machine", shared=True)
    assert leases.try_lease("machine", {}) is None
    first.release()
    assert leases.try_lease("machine", {}) is None
    second.release()
    held = take("machine")
    assert leases.try_lease("machine", {}, shared=True) is None
    held.release()


def test_what_was_left_belongs_to_those_who_inherited_it_and_then_to_nobody(folder: Path) -> None:
    held = take("cid-121")
    inherited = os.dup(held.descriptor)
    held.leave()
    assert list(leases.orphans("cid-")) == []
    os.close(inherited)
    (orphan,) = leases.orphans("cid-")
    assert (orphan.name, orphan.left) == ("cid-121", {"pid": os.getpid(), "test": "mine"})
    assert leases.try_lease("cid-121", {}) is None, "an orphan is yielded held"
    orphan.leave()
    again = take("cid-121")
    assert again.left["test"] == "mine"
    again.release()
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


def test_a_busy_lease_is_waited_for_and_its_holder_named_once(folder: Path) -> None:
    name, when, said = wait(["cid-121", "cid-122"], (30.0, take("cid-121")), (20.0, take("cid-122")))
    assert (name, said) == ("cid-122", [f"waiting for test mine of process {os.getpid()}"])
    assert when == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("text", ["", "[]", '{"names": 3}', "[" * 100_000])
def test_a_damaged_file_stands_for_its_name_as_long_as_somebody_has_it(folder: Path, text: str) -> None:
    (folder / "cid-121.lease").write_text(text)
    with (folder / "cid-122.lease").open("w") as file:
        file.write(text)
        file.flush()
        fcntl.flock(file, fcntl.LOCK_EX)
        assert wait(["cid-122", "cid-121"]) == ("cid-121", 0.0, [])
        assert leases.holder("cid-122") == "another process"


def test_a_lease_that_cannot_be_written_is_not_held(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", full)
        with pytest.raises(OSError, match="No space left"):
            leases.try_lease("cid-121", {})
    take("cid-121").release()


def test_waiting_has_a_limit(folder: Path) -> None:
    held = take("cid-121")
    with pytest.raises(LeaseTimeout) as caught:
        wait(["cid-121"], patience_s=60.0)
    holder = f"test mine of process {os.getpid()}"
    assert str(caught.value) == f"no cid came free within 60 s; {holder} holds one"
    held.release()
