"""What services use and wait for, by a ``/proc`` that is written for each test, and by the kernel's own."""

import os
import shutil
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load.service_use import Snapshot, UseReader

TICK = 1 / os.sysconf("SC_CLK_TCK")
MB = 1 << 20


class Proc:
    """A folder that looks like ``/proc``; ``threads`` ran and waited for ms, ``ticks`` are those of stat."""

    def __init__(self, root: Path) -> None:
        self.root = root
        (root / "self").mkdir()
        (root / "self" / "schedstat").touch()
        (root / "stat").write_text("".join(f"cpu{core} 1 1 1 1 1 1 1 1 0 0\n" for core in range(1024)))
        self.reader = UseReader(root)
        self.reader.sized.add("app")

    def put(
        self, pid: int, parent: int, ticks: int = 0, megabytes: float = 0, shares: float | None = None, *,
        state: str = "S", session: int = 0, start: int = 1, threads: dict[int, tuple[int, int]] | None = None,
    ) -> None:  # fmt: skip
        self.end(pid)
        folder = self.root / str(pid)
        folder.mkdir()
        words = [state, str(parent), "0", str(session), *["0"] * 7, str(ticks), "0", "0", "0", *["0"] * 4, str(start)]
        (folder / "stat").write_text(f"{pid} (a (b) c) {' '.join(words)} 0\n")
        (folder / "status").write_text(f"Name:\tx\nRssAnon:\t{int(megabytes * 1024)} kB\nRssFile:\t9000 kB\n")
        if shares is not None:
            (folder / "smaps_rollup").write_text(f"1-2 [rollup]\nPss:\t9000 kB\nPss_Anon:\t{int(shares * 1024)} kB\n")
        for thread, (ran, waited) in (threads or {}).items():
            (folder / "task" / str(thread)).mkdir(parents=True)
            (folder / "task" / str(thread) / "schedstat").write_text(f"{ran * 1_000_000} {waited * 1_000_000} 7\n")

    def end(self, pid: int) -> None:
        shutil.rmtree(self.root / str(pid), ignore_errors=True)

    def used(self, **services: int) -> Snapshot:
        return self.reader.take({pid: "" if name == "sandbox" else name for name, pid in services.items()})

    def ticks(self, **services: int) -> dict[str, int]:
        return {name: round(used.processor_s / TICK) for name, used in self.used(**services).services.items()}

    def waits(self, **services: int) -> dict[str, float]:
        return {name: round(used.waited_s, 6) for name, used in self.used(**services).services.items()}

    def megabytes(self) -> float:
        return self.used(app=10).services["app"].memory / MB


@pytest.fixture
def proc(tmp_path: Path) -> Proc:
    return Proc(tmp_path)


def test_all_processes_of_a_service_add_up(proc: Proc) -> None:
    for pid, parent, ticks, megabytes in ((10, 1, 150, 3), (11, 10, 20, 2), (12, 11, 4, 1), (20, 1, 999, 500)):
        proc.put(pid, parent, ticks, megabytes)
    assert (proc.ticks(app=10), proc.megabytes()) == ({"app": 174}, 6)
    proc.put(10, 1, 160, 3, state="Z")
    proc.end(11)
    assert proc.ticks(app=10) == {"app": 174}
    proc.put(10, 1, 170, 3, state="Z")
    assert (proc.ticks(app=10), proc.megabytes()) == ({"app": 184}, 0), "what has ended has no memory"


def test_a_process_that_was_waited_for_counts_once(proc: Proc) -> None:
    """Whether or not its parent has already been told its time."""
    proc.put(10, 1, 100)
    proc.put(11, 10, 60)
    assert proc.ticks(app=10) == {"app": 160}
    proc.end(11)
    proc.put(10, 1, 160)
    assert proc.ticks(app=10) == {"app": 160}
    proc.put(10, 1, 170)
    assert proc.ticks(app=10) == {"app": 170}


def test_the_thread_that_runs_the_most_waits(proc: Proc) -> None:
    proc.put(10, 1, threads={10: (100, 90), 11: (200, 80)})
    proc.put(20, 10, threads={20: (1000, 0)})
    proc.put(99, 1, threads={99: (5000, 5000)})
    assert proc.waits(app=10) == {"app": 0.0}
    proc.put(10, 1, threads={10: (101, 990), 11: (210, 120)})
    assert proc.waits(app=10) == {"app": 0.04}
    proc.end(20)
    proc.put(20, 10, start=2, threads={20: (50, 20)})
    assert proc.waits(app=10) == {"app": 0.06}
    proc.put(20, 10, start=2, threads={20: (10, 5)})
    assert proc.waits(app=10) == {"app": 0.065}, "a thread with the number of another"


def test_orphans_stay_with_the_service_that_started_them(proc: Proc) -> None:
    """By their session, where process 1 has collected them; else they belong to none."""
    services = {"sandbox": 1, "app": 10, "camera": 11}
    proc.put(1, 0, 9000)
    proc.put(10, 1, 20, session=10)
    proc.put(21, 1, 3, session=10)
    assert proc.ticks(**services) == {"app": 23, "camera": 0}
    proc.end(10)
    proc.put(22, 1, 4, session=22)
    assert proc.ticks(**services) == {"app": 23, "camera": 0, "": 4}


def test_what_processes_share_counts_once(proc: Proc) -> None:
    """Forks share what they have not written to; new ones at once."""
    proc.put(10, 1, megabytes=100, shares=40)
    proc.put(11, 10, megabytes=100, shares=50)
    assert proc.megabytes() == pytest.approx(90, abs=1e-5)
    for pid in (10, 11, 12, 13):
        proc.put(pid, 10 if pid > 10 else 1, megabytes=100, shares=25)
    assert proc.megabytes() == pytest.approx(100, abs=1e-5)
    proc.end(13)
    (proc.root / "12" / "smaps_rollup").unlink()
    assert proc.megabytes() == pytest.approx(50, abs=1e-5), "one has ended meanwhile"
