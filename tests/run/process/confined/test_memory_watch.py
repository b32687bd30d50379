"""Memory of processes as ``/proc`` tells it, in a folder that looks like it."""

import os
from pathlib import Path

from dodo_dsl.run.process.confined.memory_watch import above

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
