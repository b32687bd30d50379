"""The library that gives programs the test's time: waits end by it, in one order, as fast as the programs compute."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.services.clock.native.application import Application, compiled, refusal

WAITS = {
    "sleeps": "nanosleep 0 at 10, until 0 at 25, until 0 at 30, sleep 0 at 2030, time 1 at 2030, bad -1 at 2030",
    "conds": "timed 110 at 20, signals 1 at 50, clock 0 at 55, signals 2 at 65, waited 2 at 70",
    "semaphores": "free 0 at 0, none -1 at 0, timed -1 at 20, posted 0 at 35, clock 0 at 50",
    "locks": (
        "busy 16 at 10, timed 110 at 20, locked 0 at 30, reads 0 at 30, timed 110 at 40, writes 0 at 60, joined 0 at 60"
    ),
    "futexes": "timed -1 at 40, other -1 at 40, none 0 at 40",
    "files": (
        "select 0 at 20, left 0 at 20, poll 0 at 40, epoll 0 at 60, poll 1 at 70, epoll 1 at 70, read 1 at 70, "
        "recv -1 at 100, recv 1 at 110, none -1 at 110, pipe 0 at 110, read 1 at 120, nothing 0 at 130"
    ),
    "queues": ("timed -1 at 20, received 1 at 30, sent 0 at 30, full -1 at 50, epoll 0 at 70, select 0 at 90"),
    "numbers": "fclose 0 at 0, dup 100000 at 0, dup2 0 at 0, range 0 at 0, timer 1 at 10",
    "datagrams": "sent 1 at 7, got 1 at 7, stamped 0 at 7, then 7 at 7, shut 0 at 17",
    "timers": (
        "read 8 at 15, count 1 at 15, left 5000 at 40, read 8 at 40, count 2 at 40, signal 14 at 60, sleep -1 at 60, "
        "create 0 at 60, signal 14 at 65, pause -1 at 65"
    ),
    "signals": (
        "same 1 at 0, killed 0 at 10, signal 10 at 10, sleep -1 at 10, left 40 at 10, signal 10 at 11, "
        "semaphore -1 at 11, none -1 at 26, waited 12 at 26"
    ),
    "system_v": "timed -1 at 25, taken 0 at 35, waited 1 at 35",
    "forks": (
        "child 0 at 20, ended 3 at 20, nap 0 at 35, executed 5 at 35, nap 0 at 50, spawned 5 at 50, system 4 at 1050, "
        "cloned 6 at 1060, cloned 0 at 1070, uring -1 at 1070, killed 9 at 1080, end 0 at 1180"
    ),
    "shares": "timed -1 at 20, posted 0 at 30",
    "spins": "clock 1009008 at 10, yields 1 at 16",
    "garbage": "wrote 0 at 50",
}
CPP = "condition 1 at 20, until 1 at 40, notified 1 at 50, early 1 at 60, ready 1 at 80, locked 0 at 95"
PYTHON = (
    "item 0 at 10, item 1 at 20, item 2 at 30, empty at 50, select [] at 60, timeout at 90, alarm at 100, "
    "asyncio at 130, shell slept at 2130, from a child at 2180"
)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    why = refusal()
    if why:
        pytest.skip(why)
    return compiled(tmp_path_factory.mktemp("native"))


def words_of(output: str) -> str:
    return ", ".join(output.splitlines())


@pytest.mark.parametrize("libc", ["programs", "musl"])
@pytest.mark.parametrize("program", WAITS)
def test_waits_end_by_the_time_of_the_test(built: Path, program: str, libc: str) -> None:
    if not (built / libc).exists():
        pytest.skip("needs musl-gcc (musl-tools)")
    with Application(built, [built / libc, program]) as application:
        application.run(3)
        assert application.code() == 0
        assert words_of(application.output()) == WAITS[program]


def test_time_goes_no_further_than_it_may(built: Path) -> None:
    with Application(built, [built / "programs", "ticks"]) as application:
        application.run(9.999)
        assert application.output() == ""
        application.run(10.001)
        assert application.output() == "ticks 0 at 20000\n"


def test_python_waits_by_the_time_of_the_test(built: Path) -> None:
    outputs = []
    for seed in (1, 1, 2):
        with Application(
            built, [sys.executable, "-S", Path(__file__).with_name("program.py")], seed=seed
        ) as application:
            application.run(1)
            assert application.code() == 0, application.output()
            outputs.append(application.output())
    waits, drawn = outputs[0].rsplit("random", 1)
    assert words_of(waits) == PYTHON
    assert outputs[1] == outputs[0]
    assert outputs[2].rsplit("random", 1)[0] == waits
    assert outputs[2].rsplit("random", 1)[1] != drawn


@pytest.mark.slow
def test_the_cpp_library_waits_by_the_time_of_the_test(built: Path) -> None:
    source = Path(__file__).with_name("program.cpp")
    try:
        subprocess.run(["c++", "-std=c++17", "-pthread", "-o", built / "program", source], check=True, timeout=60)
    except FileNotFoundError:
        pytest.skip("needs a C++ compiler")
    drawn = set()
    for _ in range(2):
        with Application(built, [built / "program"]) as application:
            application.run(1)
            assert application.code() == 0
            *waits, value = application.output().splitlines()
            assert ", ".join(waits) == CPP
            drawn.add(value)
    assert len(drawn) == 1


def test_random_numbers_follow_from_the_seed_and_the_service(built: Path) -> None:
    program = [str(built / "programs"), "randoms"]
    drawn = []
    for seed in (7, 7, 8):
        with Application(built, program, program, seed=seed) as application:
            application.run(1)
            assert application.code(0) == application.code(1) == 0
            drawn.append((application.output(0), application.output(1)))
    assert drawn[0] == drawn[1]
    assert len({*drawn[0], *drawn[2]}) == 4


def test_what_cannot_be_preloaded_is_noted(built: Path) -> None:
    static = str(built / "static")
    source = "void _start(void) { __builtin_trap(); }"
    words = ["cc", "-x", "c", "-nostdlib", "-static", "-o", static, "-"]
    subprocess.run(words, input=source, text=True, check=True, timeout=60)
    program = f"import os, time; time.sleep(11); os.spawnv(os.P_WAIT, {static!r}, ['static'])"
    with Application(built, [sys.executable, "-S", "-c", program]) as application:
        notes = application.run(2)["notes"]
    assert notes == [{"kind": "static", "service": 0, "name": static[:56]}]


def test_a_spinning_program_is_noted(built: Path) -> None:
    with Application(built, [built / "programs", "spins"]) as application:
        assert application.run(1)["notes"] == [{"kind": "spin", "service": 0, "name": "programs"}]


def test_the_events_of_fast_dds_may_spin(built: Path) -> None:
    (built / "dds.ev.0").symlink_to("programs")
    with Application(built, [built / "dds.ev.0", "spins"]) as application:
        assert application.run(1)["notes"] == []


def test_who_wakes_again_and_again_is_named(built: Path) -> None:
    with Application(built, [built / "programs", "storm"]) as application:
        busy = application.run(1, "busy")["busy"]
    assert (busy["service"], busy["name"], busy["state"]) == (0, "programs", "W")


@pytest.mark.parametrize("variables", [{}, {"DODO_TIME": "/nowhere"}])
def test_without_the_page_no_program_runs(built: Path, variables: dict[str, str]) -> None:
    environment = {"LD_PRELOAD": str(built / "libdodo-time.so"), **variables}
    words = [str(built / "programs"), "nap"]
    ended = subprocess.run(words, check=False, env=environment, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 127
    assert ended.stderr.startswith("DoDo's clock: ")
    assert ended.stderr.count("\n") == 1


def outputs_of_workers(built: Path) -> str:
    with Application(built, [built / "programs", "workers"], [built / "programs", "workers"]) as application:
        application.run(1)
        assert application.code(0) == application.code(1) == 0
        return application.output(0) + application.output(1)


def test_threads_take_turns_in_one_order(built: Path) -> None:
    assert len({outputs_of_workers(built) for _ in range(3)}) == 1
