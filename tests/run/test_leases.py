"""Leases: held, shared, waited for, left to others, and with records that are damaged or another user's."""

import asyncio
import fcntl
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


def test_waiters_are_served_in_the_order_in_which_they_came(folder: Path) -> None:
    held, served, said = take("cid-121"), [], {name: [] for name in "abc"}

    async def waiter(name: str) -> None:
        lease = await leases.lease_any(["cid-121"], {"test": name}, said[name].append)
        served.append(name)
        await asyncio.sleep(3.0)
        lease.release()

    async def scene() -> None:
        tasks = []
        for name in "abc":
            tasks.append(asyncio.ensure_future(waiter(name)))
            await asyncio.sleep(0.05)
        held.release()
        late = leases.lease_any(["cid-121"], {"test": "late"}, said.setdefault("late", []).append)
        (await late).release()
        assert served == ["a", "b", "c"], "who comes when it is free waits behind them"
        await asyncio.gather(*tasks)

    run(scene())
    mine = f"of process {os.getpid()}"
    assert said["a"] == [f"waiting for test mine {mine}"]
    assert said["b"] == [f"waiting for test mine {mine}, and 1 waits before this one", f"waiting for test a {mine}"]
    assert said["c"][0] == f"waiting for test mine {mine}, and 2 wait before this one"
    assert len(said["c"]) == 3 and said["late"][0].endswith("and 3 wait before this one")
    assert [path.name for path in folder.iterdir()] == ["cid-121.lock"]


def test_who_waits_for_any_is_served_by_the_first_that_is_free_and_holds_up_no_other(folder: Path) -> None:
    """The first waits for two; the second for one of them and for another, which nobody wants."""
    held = [take("cid-121"), take("cid-122")]

    async def scene() -> list[str]:
        first = asyncio.ensure_future(leases.lease_any(["cid-121", "cid-122"], {"test": "a"}, lambda _: None))
        await asyncio.sleep(0.05)
        second = await leases.lease_any(["cid-122", "cid-123"], {"test": "b"}, lambda _: None)
        held[1].release()
        names = [second.name, (await first).name]
        for lease in (second, first.result()):
            lease.release()
        return names

    assert run(scene()) == ["cid-123", "cid-122"]
    held[0].release()


def test_shared_use_waits_behind_an_exclusive_one_that_came_before(folder: Path) -> None:
    held, served = take("machine", shared=True), []

    async def waiter(name: str, shared: bool) -> None:
        lease = await leases.lease_any(["machine"], {"test": name}, lambda _: None, shared)
        served.append(name)
        await asyncio.sleep(1.0)
        lease.release()

    async def scene() -> None:
        tasks = []
        for name, shared in (("alone", False), ("one", True), ("two", True)):
            tasks.append(asyncio.ensure_future(waiter(name, shared)))
            await asyncio.sleep(0.05)
        assert served == []
        held.release()
        await asyncio.gather(*tasks)

    run(scene())
    assert served == ["alone", "one", "two"]


def test_who_gives_up_leaves_the_queue(folder: Path) -> None:
    held = take("cid-121")

    async def scene() -> None:
        waiter = asyncio.ensure_future(leases.lease_any(["cid-121"], {"test": "gone"}, lambda _: None))
        await asyncio.sleep(0.05)
        assert len(list(folder.glob("queue.*"))) == 1
        waiter.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiter
        assert list(folder.glob("queue.*")) == []

    run(scene())
    held.release()


WAITS = """
import asyncio, sys
from dodo_dsl.run import leases
async def wait():
    await leases.lease_any(["cid-121"], {"test": "dies"}, lambda text: print(text, flush=True))
asyncio.run(wait())
"""


def test_a_waiter_that_is_killed_is_skipped_and_its_ticket_removed(folder: Path) -> None:
    held = take("cid-121")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, "-c", WAITS], env=environment, stdout=subprocess.PIPE, text=True) as killed:
        assert killed.stdout is not None
        assert killed.stdout.readline() == f"waiting for test mine of process {os.getpid()}\n"
        said: list[str] = []

        async def scene() -> None:
            waiter = asyncio.ensure_future(leases.lease_any(["cid-121"], {"test": "next"}, said.append))
            await asyncio.sleep(0.05)
            held.release()
            await asyncio.sleep(0.05)
            assert not waiter.done(), "the first in the queue has not looked yet, or took it"
            killed.kill()
            killed.wait()
            (await waiter).release()

        run(scene())
    assert said[0].endswith("and 1 waits before this one")
    assert list(folder.glob("queue.*")) == []


@pytest.mark.parametrize("text", ["[]", "3", '{"names": 3, "shared": 0, "turn": 0}', "[" * 100_000])
def test_a_damaged_ticket_holds_up_nobody(folder: Path, text: str) -> None:
    """Nobody holds the one; the other's process lives."""
    (folder / "queue.1.1.1").write_text(text)
    with (folder / "queue.2.1.1").open("w") as file:
        file.write(text)
        file.flush()
        fcntl.flock(file, fcntl.LOCK_EX)
        assert wait(["cid-121"]) == ("cid-121", 0.0, [])
    leases.forget_dead()
    assert list(folder.glob("queue.*")) == []


def test_all_that_is_waited_for_within_a_turn_keeps_its_place(folder: Path) -> None:
    """A test that has waited for one lease is not the last again for the next."""
    with leases.arrived():
        since = leases.arrival_time()
        with leases.ticket(folder, ["cid-121"], since):
            (asyncio.run(leases.lease_any(["cid-121"], {}, print))).release()
    assert leases.arrival_time() > since


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
