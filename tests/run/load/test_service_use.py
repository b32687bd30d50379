"""What services use, by a ``/proc`` that is written for each test, and by the kernel's own."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load import service_use
from dodo_dsl.run.machine_load.service_use import Used, UseReader

TICK = 1 / os.sysconf("SC_CLK_TCK")
MB = 1 << 20


def put(
    proc: Path,
    pid: int,
    parent: int,
    ticks: tuple[int, int] = (0, 0),
    megabytes: int = 0,
    proportional: int | None = None,
    state: str = "S",
) -> None:
    """A process; ``ticks`` are its own and those of the children that it waited for."""
    folder = proc / str(pid)
    folder.mkdir(exist_ok=True)
    own, waited = ticks
    words = [state, str(parent), *["0"] * 9, str(own), "0", "0", str(waited), *["0"] * 10]
    (folder / "stat").write_text(f"{pid} (a (b) c) {' '.join(words)}\n")
    (folder / "status").write_text(f"Name:\tx\nRssAnon:\t{megabytes * 1024} kB\nRssShmem:\t0 kB\n")
    if proportional is not None:
        (folder / "smaps_rollup").write_text(f"1-2 [rollup]\nPss_Anon:\t{proportional * 1024} kB\n")


def end(proc: Path, pid: int) -> None:
    for path in (proc / str(pid)).iterdir():
        path.unlink()
    (proc / str(pid)).rmdir()


def test_all_processes_of_a_service_add_up(tmp_path: Path) -> None:
    put(tmp_path, 10, 1, (100, 50), 3)
    put(tmp_path, 11, 10, (20, 0), 2)
    put(tmp_path, 12, 11, (4, 0), 1)
    put(tmp_path, 20, 1, (999, 0), 500)
    found = UseReader(tmp_path).take({10: "app"})
    assert found == {"app": Used(pytest.approx(174 * TICK), 6 * MB)}


def test_a_process_that_was_waited_for_counts_once(tmp_path: Path) -> None:
    """Whether or not its parent has already been told its time; also one that is not waited for."""
    use = UseReader(tmp_path)
    put(tmp_path, 10, 1, (100, 0))
    put(tmp_path, 11, 10, (50, 0))
    put(tmp_path, 12, 10, (7, 0))
    assert use.take({10: "app"})["app"].processor_s == pytest.approx(157 * TICK)
    put(tmp_path, 11, 10, (60, 0), state="Z")
    assert use.take({10: "app"})["app"].processor_s == pytest.approx(167 * TICK)
    end(tmp_path, 11)
    put(tmp_path, 10, 1, (100, 60))
    assert use.take({10: "app"})["app"].processor_s == pytest.approx(167 * TICK)
    end(tmp_path, 12)
    assert use.take({10: "app"})["app"].processor_s == pytest.approx(167 * TICK)
    put(tmp_path, 10, 1, (110, 60))
    assert use.take({10: "app"})["app"].processor_s == pytest.approx(177 * TICK)


def test_what_processes_share_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forks share what they have not written to; a small one has no say in that."""
    put(tmp_path, 10, 1, megabytes=100, proportional=40)
    put(tmp_path, 11, 10, megabytes=100, proportional=50)
    put(tmp_path, 12, 10, megabytes=2)
    assert UseReader(tmp_path).take({10: "app"})["app"].memory == pytest.approx(92 * MB, abs=2)
    (tmp_path / "11" / "smaps_rollup").unlink()
    assert UseReader(tmp_path).take({10: "app"})["app"].memory == 202 * MB, "not everybody may know"
    sizes = iter((100, 100, 2, 100, 0))
    monkeypatch.setattr(service_use, "resident", lambda *_: (next(sizes) * MB, 0))
    assert UseReader(tmp_path).take({10: "app"})["app"].memory == 100 * MB, "one has ended meanwhile"


def test_new_forks_count_when_it_is_known_what_they_share(tmp_path: Path) -> None:
    use = UseReader(tmp_path)
    for pid in (10, 11):
        put(tmp_path, pid, 1 if pid == 10 else 10, megabytes=100, proportional=50)
    assert use.take({10: "app"})["app"].memory == 100 * MB
    for pid in (12, 13):
        put(tmp_path, pid, 10, megabytes=100, proportional=25)
    use._look({10: "app"})
    assert use.take({10: "app"})["app"].memory == 100 * MB
    for pid in (10, 11):
        put(tmp_path, pid, 1 if pid == 10 else 10, megabytes=1)
    assert use.take({10: "app"})["app"].memory == 100 * MB, "one alone, until it is known"


def test_a_service_that_has_ended_keeps_its_time(tmp_path: Path) -> None:
    use = UseReader(tmp_path)
    put(tmp_path, 10, 1, (100, 5), 3)
    use.take({10: "app"})
    put(tmp_path, 10, 1, (130, 9), state="Z")
    use.note_end(10, "app")
    end(tmp_path, 10)
    assert use.take({10: "app"})["app"] == Used(pytest.approx(139 * TICK), 0)


@contextmanager
def started(code: str) -> Iterator["subprocess.Popen[str]"]:
    """A program that has printed a line and waits."""
    words = [sys.executable, "-c", f"import os, sys, time\n{code}\nprint(1, flush=True)\nsys.stdin.read()"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process
        process.kill()


BUSY = "end = time.process_time() + 0.3\nwhile time.process_time() < end: pass\n"


@pytest.mark.parametrize(
    ("code", "processor_s", "megabytes"),
    [
        ("", 0.0, 0),
        (BUSY, 0.3, 0),
        (f"if os.fork() == 0:\n    {BUSY.replace(chr(10), chr(10) + '    ')}\n    os._exit(0)\nos.wait()\n", 0.3, 0),
        ("kept = bytearray(os.urandom(1 << 20)) * 64\n", 0.0, 64),
        ("kept = bytearray(os.urandom(1 << 20)) * 64\nfor _ in range(3):\n    os.fork() or time.sleep(60)\n", 0.0, 64),
    ],
    ids=["quiet", "busy", "busy-child", "large", "forks"],
)
@pytest.mark.thorough
def test_the_kernel_s_own(code: str, processor_s: float, megabytes: int) -> None:
    with started("") as plain, started(code) as process:
        time.sleep(0.05)  # forks go to sleep
        use = UseReader().take({plain.pid: "plain", process.pid: "app"})
        for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
            os.kill(int(child), 9)
    assert use["app"].processor_s - use["plain"].processor_s >= processor_s - 0.05
    more = (use["app"].memory - use["plain"].memory) / MB
    assert megabytes - 1 <= more <= megabytes + 16, "what forks write to is their own"


CHILD_LATER = """
import subprocess, sys
input()
code = "held = bytearray(b'x' * 50_000_000); print('held', flush=True); input()"
subprocess.run([sys.executable, "-c", code])
"""


@pytest.mark.thorough
def test_a_process_that_begins_after_the_first_look_counts_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sandbox that is looked at while it is set up has not started the application yet."""
    monkeypatch.setattr(service_use, "_LOOK_S", 1e6)
    words = [sys.executable, "-c", CHILD_LATER]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        use = UseReader()
        assert use.take({process.pid: "app"})["app"].memory < 50_000_000
        process.stdin.write("\n")
        process.stdin.flush()
        assert process.stdout.readline() == "held\n"
        assert use.take({process.pid: "app"})["app"].memory > 50_000_000
        process.stdin.close()


def test_system_v_memories_count_beside_what_is_mapped(tmp_path: Path) -> None:
    put(tmp_path, 10, 1, megabytes=3)
    (tmp_path / "sysvipc").mkdir()
    rows = ((10, 0, 50), (10, 1, 7), (1, 0, 900))
    text = "".join(f"{pid} {users} {size * MB} {MB}\n" for pid, users, size in rows)
    (tmp_path / "sysvipc" / "shm").write_text(f"cpid nattch rss swap\n{text}")
    assert UseReader(tmp_path).take({10: "app"})["app"].memory == 62 * MB
