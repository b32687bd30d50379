"""Memory of processes as ``/proc`` tells it, in a folder that looks like it."""

import os
from pathlib import Path

import pytest

from dodo_dsl.run.process.confined_process import above

PARENTS = {10: 1, 11: 10, 12: 11, 20: 1, 30: 2}


def proc(folder: Path, resident: dict[int, int], proportional: dict[int, int]) -> Path:
    for pid, kilobytes in resident.items():
        (folder / str(pid)).mkdir()
        (folder / str(pid) / "status").write_text(f"Name:\tx\nRssAnon:\t{kilobytes} kB\nRssFile:\t9000 kB\n")
        (folder / str(pid) / "smaps_rollup").write_text(f"Pss:\t9000 kB\nPss_Anon:\t{proportional[pid]} kB\n")
    return folder


def test_a_service_is_charged_with_what_it_started(tmp_path: Path) -> None:
    sizes = {10: 400, 11: 400, 12: 400, 20: 1000, 30: 9000}
    found = above({10: 1000 * 1024, 20: 1000 * 1024}, PARENTS, proc(tmp_path, sizes, sizes))
    assert found == {10: 1200 * 1024}


def test_shared_pages_count_once(tmp_path: Path) -> None:
    """Forks share what they have not written to."""
    resident, proportional = dict.fromkeys((10, 11, 12, 20, 30), 900), dict.fromkeys((10, 11, 12, 20, 30), 300)
    assert above({10: 1000 * 1024}, PARENTS, proc(tmp_path, resident, proportional)) == {}


def test_processes_that_end_meanwhile_are_no_problem(tmp_path: Path) -> None:
    assert above({10: 1}, PARENTS, tmp_path) == {}


@pytest.mark.thorough
def test_what_only_a_descriptor_holds_counts_once() -> None:
    """Also where a child holds it, too, as forks do."""
    me, parents = os.getpid(), {os.getpid(): 1}
    before = above({me: 0}, parents)[me]
    first = os.memfd_create("x")
    second = os.dup(first)
    try:
        os.write(first, bytes(64 << 20))
        assert above({me: 0}, parents)[me] - before > 50 << 20
        assert above({me: before + (100 << 20)}, parents) == {}
    finally:
        os.close(first)
        os.close(second)


def shm(proc: Path, *rows: tuple[int, int, int]) -> None:
    """System V memories by creator, number of attached processes and bytes."""
    (proc / "sysvipc").mkdir()
    text = "key shmid perms size cpid lpid nattch uid gid cuid cgid atime dtime ctime rss swap\n"
    text += "".join(f"0 1 600 999 {pid} 1 {users} 0 0 0 0 0 0 0 {size} 0\n" for pid, users, size in rows)
    (proc / "sysvipc" / "shm").write_text(text)


def test_system_v_memories_count_with_the_service_that_made_them(tmp_path: Path) -> None:
    """Also those to which no process is attached; not those of DoDo's services or of other namespaces."""
    sizes = {10: 100, 20: 100}
    shm(proc(tmp_path, sizes, sizes), (12, 0, 500 * 1024), (10, 1, 200 * 1024), (30, 0, 7000), (0, 0, 7000))
    found = above({10: 1, 20: 1}, PARENTS, tmp_path)
    assert found == {10: 800 * 1024, 20: 100 * 1024}


def test_those_of_a_creator_that_has_ended_count_in_own_namespaces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shm(proc(tmp_path, {10: 100}, {10: 100}), (77, 0, 500 * 1024))
    assert above({10: 1}, PARENTS, tmp_path) == {10: 100 * 1024}
    monkeypatch.setattr(os, "getpid", lambda: 1)
    assert above({10: 1}, PARENTS, tmp_path) == {10: 600 * 1024}
