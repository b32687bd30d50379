"""The processor time of real processes, as the kernel counts it."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from services.clock.processor_time import (
    Account,
    ApplicationProcesses,
    ProcessorTimes,
    Spent,
    ThreadSpent,
    contention_s,
    descendants,
    own_wait_s,
)

TICK = 1 / os.sysconf("SC_CLK_TCK")
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


@pytest.mark.thorough
def test_threads_that_ended_and_children_count(tmp_path: Path) -> None:
    (tmp_path / "burn.py").write_text(BURN)
    command = [sys.executable, str(tmp_path / "burn.py")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        parent = ran(process.pid)
        assert parent >= 0.2
        while ran(process.pid) < 0.4:  # the child burns as much
            assert process.poll() is None
        assert len(descendants(frozenset([process.pid]), Path("/proc"))) == 2
        process.communicate(b"")
    assert ran(process.pid) == 0.0


def ran(pid: int) -> float:
    """All that a process and its descendants ran so far, in s."""
    return sum(ApplicationProcesses([pid]).snapshot().ran_s.values())


def test_it_agrees_with_what_the_process_knows_of_itself() -> None:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    mine = ApplicationProcesses([os.getpid()]).snapshot().ran_s[os.getpid()]
    assert mine == pytest.approx(usage.ru_utime + usage.ru_stime, rel=0.02, abs=0.05)


def write(proc: Path, pid: int, threads: dict[int, tuple[float, float]]) -> None:
    for thread, (running, waiting) in threads.items():
        folder = proc / str(pid) / "task" / str(thread)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "schedstat").write_text(f"{running * 1e9:.0f} {waiting * 1e9:.0f} 3\n")
    (proc / str(pid) / "stat").write_text(f"{pid} (a) name) S 1 {pid}\n")


def test_a_process_waits_as_long_as_its_busiest_thread(tmp_path: Path) -> None:
    """One that only looks for work waits for longer, and nobody waits for it."""
    write(tmp_path, 7, {7: (1.0, 0.5), 8: (0.1, 3.0)})
    write(tmp_path, 9, {9: (2.0, 0.0)})
    processes = ApplicationProcesses([7, 9], tmp_path)
    before = processes.snapshot()
    write(tmp_path, 7, {7: (1.3, 0.75), 8: (0.11, 3.5)})
    write(tmp_path, 9, {9: (2.2, 0.125), 10: (0.1, 0.1)})
    assert processes.snapshot().since(before).waited_s == pytest.approx(0.375)


def test_others_do_not_count(tmp_path: Path) -> None:
    write(tmp_path, 7, {7: (1.0, 0.5)})
    write(tmp_path, 9, {9: (1.0, 0.5)})
    assert descendants(frozenset([7]), tmp_path) == [7]


def test_what_ended_in_between_takes_nothing_back() -> None:
    before = ProcessorTimes({7: 1.0, 8: 1.0}, {7: {"7": ThreadSpent(1.0, 0.5)}})
    after = ProcessorTimes({7: 1.25}, {7: {}})
    assert after.since(before) == Spent(0.25, 0.0)


def taken(ran_s: dict[int, float], waited_s: float, account: Account) -> ProcessorTimes:
    threads = {pid: {str(pid): ThreadSpent(ran, waited_s)} for pid, ran in ran_s.items()}
    return ProcessorTimes(ran_s, threads, account)


def waits(ran_s: dict[int, float], waited_s: float, application_s: float | None, machine_s: float, begun: int) -> Spent:
    """What counts as wait when the machine's processors were used for this time."""
    before = taken(dict.fromkeys(ran_s, 0.0), 0.0, Account(None if application_s is None else 0.0, 0.0, 7))
    return taken(ran_s, waited_s, Account(application_s, machine_s, begun)).since(before)


def test_processes_of_the_application_that_compete_are_its_own_fault() -> None:
    """Each waits while others of it run: what is excused is what others took, to one tick of the kernel."""
    hogs = dict.fromkeys(range(24), 0.01)
    assert waits(hogs, 0.2, None, 0.24, 7).waited_s <= TICK
    assert waits({1: 0.01}, 0.2, None, 0.4, 7).waited_s == 0.2, "alone it waits for others only"
    assert waits({1: 0.01}, 0.2, None, 0.05, 7).waited_s == pytest.approx(0.04 + TICK)


def test_the_clocks_own_wait_is_excused_as_far_as_others_took_the_processors() -> None:
    """Else an application makes the clock wait for its children, and wakes it with messages."""
    before = taken({1: 0.0}, 0.0, Account(0.0, 0.0, 7))
    now = taken({1: 0.01}, 0.2, Account(0.3, 0.4 - TICK, 99))
    assert now.by_others(before, 0.08) == pytest.approx(0.02)
    assert now.by_others(before, 9.0) == pytest.approx(0.1)
    assert now.since(before, 0.1).waited_s == pytest.approx(0.0)
    assert ProcessorTimes({}, {}).by_others(ProcessorTimes({}, {}), 9.0) == 9.0


def test_children_that_ended_are_no_others() -> None:
    """By the account of the application's control group; without one, whatever began may have been any of them."""
    assert waits({1: 0.01}, 0.2, 0.4, 0.4, 99) == Spent(0.4, pytest.approx(0.2 * TICK / (TICK + 0.39), abs=TICK))
    assert waits({1: 0.01}, 0.2, None, 0.4, 99) == Spent(0.01, 0.0)
    before = taken({1: 0.0, 2: 0.0}, 0.0, Account(None, 0.0, 7))
    assert taken({1: 0.01}, 0.2, Account(None, 0.4, 7)).since(before).waited_s == 0.0, "one that ended"


@pytest.mark.parametrize(
    ("version", "line", "file", "text"),
    [
        (1, "5:cpu,cpuacct:/docker/dodo-1", "cpuacct.usage", "2500000000\n"),
        (2, "0::/docker/dodo-1", "cpu.stat", "usage_usec 2500000\nuser_usec 1\n"),
    ],
)
def test_the_account_is_that_of_the_services_own_group(
    tmp_path: Path, version: int, line: str, file: str, text: str
) -> None:
    write(tmp_path, 7, {7: (1.0, 0.5)})
    kind, options = ("cgroup", "rw,cpu,cpuacct") if version == 1 else ("cgroup2", "rw")
    (tmp_path / "self").mkdir()
    (tmp_path / "self" / "mountinfo").write_text(f"31 30 0:27 /docker {tmp_path}/tree rw - {kind} none {options}\n")
    (tmp_path / "tree" / "dodo-1").mkdir(parents=True)
    (tmp_path / "tree" / "dodo-1" / file).write_text(text)
    (tmp_path / "stat").write_text("cpu 9 9\n" + "".join(f"cpu{core} 100 0 0 900 0 0 0 0\n" for core in range(4096)))
    (tmp_path / "loadavg").write_text("1 1 1 1/2 42\n")
    (tmp_path / "7" / "cgroup").write_text(f"8:pids:/docker/dodo-1\n{line}\n")
    found = ApplicationProcesses([7], tmp_path).snapshot().account
    assert found is not None
    assert (found.application_s, found.machine_s) == (2.5, pytest.approx(100 * TICK * len(os.sched_getaffinity(0))))
    (tmp_path / "7" / "cgroup").write_text(line.replace("dodo-1", "others") + "\n")
    shared = ApplicationProcesses([7], tmp_path).snapshot().account
    assert shared is not None and shared.application_s is None, "a group with others in it"


def test_contention_is_the_total_of_some_in_seconds(tmp_path: Path) -> None:
    rows = (
        "some avg10=88.09 avg60=66.82 avg300=72.62 total=41558549961\nfull avg10=0.00 avg60=0.00 avg300=0.00 total=7\n"
    )
    (tmp_path / "cpu").write_text(rows)
    assert contention_s(tmp_path / "cpu") == 41558.549961
    (tmp_path / "cpu").write_text("none\n")
    assert contention_s(tmp_path / "cpu") == contention_s(tmp_path / "none") == 0.0


def test_the_own_wait_is_the_second_number_of_the_kernels_in_seconds(tmp_path: Path) -> None:
    (tmp_path / "schedstat").write_text("7000000000 2500000000 12\n")
    assert own_wait_s(str(tmp_path / "schedstat")) == 2.5
    assert own_wait_s(str(tmp_path / "none")) == 0.0
