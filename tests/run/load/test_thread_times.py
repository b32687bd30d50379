"""What services ran and waited, by a ``/proc`` that is written for each test, and by the kernel's own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load.processes import ThreadTimes


class Proc:
    """A folder that looks like ``/proc``; times in ms."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def put(self, pid: int, parent: int, threads: dict[int, tuple[int, int]], session: int = 0, start: int = 1) -> None:
        self.end(pid)
        fields = ["S", str(parent), "0", str(session), *["0"] * 15, str(start)]
        (self.root / str(pid)).mkdir(parents=True)
        (self.root / str(pid) / "stat").write_text(f"{pid} (a (b) c) {' '.join(fields)} 0\n")
        for thread, (ran, waited) in threads.items():
            folder = self.root / str(pid) / "task" / str(thread)
            folder.mkdir(parents=True)
            (folder / "schedstat").write_text(f"{ran * 1_000_000} {waited * 1_000_000} 7\n")

    def end(self, pid: int) -> None:
        for path in sorted((self.root / str(pid)).rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        if (self.root / str(pid)).is_dir():
            (self.root / str(pid)).rmdir()


@pytest.fixture
def proc(tmp_path: Path) -> Proc:
    (tmp_path / "sys").mkdir()
    return Proc(tmp_path)


def test_threads_run_together_and_the_one_that_runs_the_most_waits(proc: Proc) -> None:
    times = ThreadTimes(proc.root)
    proc.put(10, 1, {10: (100, 90), 11: (200, 80)})
    proc.put(20, 10, {20: (1000, 0)})
    proc.put(99, 1, {99: (5000, 5000)})
    assert times.add_up({10: "app"}) == {"app": pytest.approx((1.3, 0.0))}
    proc.put(10, 1, {10: (101, 990), 11: (210, 120)})
    assert times.add_up({10: "app"}) == {"app": pytest.approx((1.311, 0.04))}, "the thread that ran more"


def test_what_has_ended_counts_as_far_as_it_was_seen(proc: Proc) -> None:
    times = ThreadTimes(proc.root)
    proc.put(10, 1, {10: (0, 7)})
    proc.put(20, 10, {20: (300, 100)})
    times.add_up({10: "app"})
    proc.end(20)
    assert times.add_up({10: "app"}) == {"app": pytest.approx((0.3, 0.1))}
    proc.put(20, 10, {20: (50, 20)}, start=2)
    assert times.add_up({10: "app"}) == {"app": pytest.approx((0.35, 0.12))}
    proc.put(20, 10, {20: (10, 5)}, start=2)
    assert times.add_up({10: "app"}) == {"app": pytest.approx((0.36, 0.125))}, "a thread with the number of another"


def test_orphans_stay_with_the_service_that_started_them(proc: Proc) -> None:
    """Process 1 collects them; one that was never seen with its parent is known by its session, or belongs to none."""
    services, times = {1: "", 10: "app", 11: "camera"}, ThreadTimes(proc.root)
    proc.put(1, 0, {1: (9000, 9000)})
    proc.put(10, 1, {10: (0, 0)}, session=10)
    proc.put(20, 10, {20: (100, 0)}, session=20)
    assert times.add_up(services) == {"app": (0.1, 0.0), "camera": (0.0, 0.0)}
    proc.end(10)
    proc.put(20, 1, {20: (200, 0)}, session=20)
    proc.put(21, 1, {21: (30, 0)}, session=10)
    proc.put(22, 1, {22: (4, 0)}, session=22)
    found = times.add_up(services)
    assert found == {"app": pytest.approx((0.23, 0.0)), "camera": (0.0, 0.0), "": pytest.approx((0.004, 0.0))}


def test_a_kernel_that_does_not_measure(proc: Proc) -> None:
    proc.put(10, 1, {10: (100, 10)})
    (proc.root / "10" / "task" / "10" / "schedstat").unlink()
    assert ThreadTimes(proc.root).add_up({10: "app"}) == {"app": (0.0, 0.0)}, "the thread has ended"
    (proc.root / "10" / "task" / "10" / "stat").touch()
    assert ThreadTimes(proc.root).add_up({10: "app"}) is None


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="this kernel counts no waits")
def test_the_kernel_s_own() -> None:
    """A child of a child that computes for 50 ms."""
    work = "import time\nwhile time.process_time() < 0.05: pass\nprint(flush=True); input()"
    outer = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"
    with subprocess.Popen(
        [sys.executable, "-c", outer, work], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        found = ThreadTimes().add_up({process.pid: "app", os.getpid(): ""})
        process.communicate(b"\n")
    assert found is not None
    assert found["app"][0] >= 0.05
