"""Benchmarks of three lines each: rows, budgets, and what becomes of those that fail or hang."""

import signal
import subprocess
import time
from pathlib import Path

import pytest

from benchmarks.ledger import runner
from benchmarks.ledger.row import Row, rate_row
from benchmarks.ledger.runner import GRACE, SECONDS, run, scripts

ROOT = Path(__file__).parents[2]
REPORTS = """
import json, os
with open(os.environ["DODO_BENCH_ROWS"], "a") as file:
    print(json.dumps({"what": "a", "unit": "1/s", "ours": [6.5]}), file=file)
"""
HANGS = """
import pathlib, subprocess, time
try:
    child = subprocess.Popen(["sh", "-c", "trap '' INT; sleep 999"])
    pathlib.Path("part").write_text(str(child.pid))
    pathlib.Path("part").rename("child")
    time.sleep(999)
finally:
    open("end", "w")
"""
ROW = rate_row("a", "1/s", [6.5])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "benchmarks").mkdir()
    return tmp_path / "benchmarks"


def is_running(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except FileNotFoundError:
        return False


def test_rows_are_read(folder: Path) -> None:
    (folder / "bench_a.py").write_text(f"{REPORTS}\nassert 0 < float(os.environ['DODO_BENCH_SECONDS']) < 60")
    bench = run(folder / "bench_a.py", 60)
    assert (bench.name, bench.rows, bench.trouble, bench.budget) == ("bench_a", (ROW,), "", 60)


def test_one_that_fails_says_why_in_the_rows_that_it_did_not_come_to(folder: Path) -> None:
    planned = "from benchmarks.ledger.row import plan, rate_row; plan(rate_row('b', '1/s', []))"
    (folder / "bench_a.py").write_text(f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{REPORTS}\n{planned}\nint('x')")
    bench = run(folder / "bench_a.py", 60)
    why = "ended with 1: ValueError: invalid literal for int() with base 10: 'x'"
    assert bench.rows == (ROW, Row("b", "1/s", note=why))
    assert (bench.trouble, bench.failed) == (why, True)


@pytest.mark.thorough
def test_one_that_hangs_is_ended_with_its_children_and_keeps_its_rows(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    up, wait = folder.parent / "child", runner._wait

    def wait_until_it_hangs(process: "subprocess.Popen[bytes]", _seconds: float) -> int | None:
        while not up.exists() and process.poll() is None:
            time.sleep(0.01)
        return wait(process, 0)

    monkeypatch.setattr(runner, "_wait", wait_until_it_hangs)
    (folder / "bench_a.py").write_text(f"{REPORTS}\n{HANGS}")
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as for a program that a shell starts in the background
    try:
        bench = run(folder / "bench_a.py", 60)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (bench.rows, bench.trouble, bench.failed) == ((ROW,), "did not end in 60 s, and was ended", False)
    assert (folder.parent / "end").exists(), "it may clean up"
    patience = time.monotonic() + 20
    while is_running(int(up.read_text())):
        assert time.monotonic() < patience, "its child is still there"
        time.sleep(0.01)


def test_all_stay_below_ten_minutes_even_if_some_have_to_be_ended() -> None:
    assert SECONDS.keys() == {script.stem for script in scripts(ROOT)}
    assert sum(SECONDS.values()) + 5 * GRACE < 600
