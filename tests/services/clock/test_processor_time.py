"""The processor time of real processes, as the kernel counts it."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from services.clock.processor_time import ApplicationProcesses, Spent, descendants

BURN = """
import subprocess, sys, threading, time
def burn():
    end = time.process_time() + 0.2
    while time.process_time() < end:
        pass
thread = threading.Thread(target=burn)
thread.start()
thread.join()
if sys.argv[1:] == ["child"]:
    sys.stdin.read()
else:
    child = subprocess.Popen([sys.executable, __file__, "child"], stdin=subprocess.PIPE)
    print("ready", flush=True)
    sys.stdin.read()
    child.stdin.close()
    child.wait()
"""


def test_threads_that_ended_and_children_count(tmp_path: Path) -> None:
    (tmp_path / "burn.py").write_text(BURN)
    command = [sys.executable, str(tmp_path / "burn.py")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        parent = ApplicationProcesses([process.pid]).spent()
        assert parent.ran_s >= 0.2
        while (both := ApplicationProcesses([process.pid]).spent()).ran_s < 0.4:  # the child burns as much
            assert process.poll() is None
        assert both.ran_s > parent.ran_s
        assert len(descendants(frozenset([process.pid]), Path("/proc"))) == 2
        process.communicate(b"")
    assert ApplicationProcesses([process.pid]).spent() == Spent(0.0, 0.0)


def test_it_agrees_with_what_the_process_knows_of_itself() -> None:
    before = resource.getrusage(resource.RUSAGE_SELF)
    spent = ApplicationProcesses([os.getpid()]).spent()
    after = resource.getrusage(resource.RUSAGE_SELF)
    assert before.ru_utime + before.ru_stime - 0.02 <= spent.ran_s <= after.ru_utime + after.ru_stime + 0.02


def test_the_wait_is_that_of_all_threads(tmp_path: Path) -> None:
    for thread, waited in ((7, 1_500_000_000), (8, 250_000_000)):
        (tmp_path / "7" / "task" / str(thread)).mkdir(parents=True)
        (tmp_path / "7" / "task" / str(thread) / "schedstat").write_text(f"1 {waited} 3\n")
    (tmp_path / "7" / "stat").write_text("7 (a) name) S 1 7\n")
    (tmp_path / "9").mkdir()
    (tmp_path / "9" / "stat").write_text("9 (other) S 1 9\n")
    assert descendants(frozenset([7]), tmp_path) == [7]
    assert ApplicationProcesses([7], tmp_path).spent().waited_s == pytest.approx(1.75)


def test_a_process_that_ended_in_between_takes_nothing_back() -> None:
    assert Spent(1.0, 0.5).since(Spent(2.0, 0.1)) == Spent(0.0, 0.4)
