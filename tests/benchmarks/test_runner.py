"""Benchmarks of three lines each: rows, budgets, and what becomes of those that fail or hang."""

import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks.ledger import runner
from benchmarks.ledger.row import Row, rate_row
from benchmarks.ledger.runner import GRACE, SECONDS, Interrupted, run, scripts

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


def test_modules_come_from_the_checkout_of_the_benchmark(folder: Path) -> None:
    (folder.parent / "dodo_dsl.py").write_text("")
    (folder / "bench_a.py").write_text(
        "import dodo_dsl, pathlib; assert pathlib.Path(dodo_dsl.__file__).parent == pathlib.Path().resolve()"
    )
    assert run(folder / "bench_a.py", 60).trouble == "reported no row"


def test_one_that_fails_is_told(folder: Path) -> None:
    (folder / "bench_a.py").write_text(f"{REPORTS}\nos._exit(3)")
    bench = run(folder / "bench_a.py", 60)
    assert (bench.rows, bench.trouble, bench.failed) == ((ROW,), "ended with 3", True)


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


@pytest.mark.parametrize("is_patient", [True, False])
def test_an_interrupt_ends_it_and_keeps_its_rows(
    is_patient: bool, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where somebody does not wait until it has cleaned up, nothing of it is left either."""
    up = folder.parent / "child"

    def interrupted(process: "subprocess.Popen[bytes]", _seconds: float) -> int | None:
        while not up.exists() and process.poll() is None:
            time.sleep(0.01)
        if not is_patient:
            monkeypatch.setattr(process, "wait", once_more(process.wait))
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "_wait", interrupted)
    (folder / "bench_a.py").write_text(f"{REPORTS}\n{HANGS}")
    with pytest.raises(Interrupted) as raised:
        run(folder / "bench_a.py", 60)
    assert (raised.value.bench.rows, raised.value.bench.trouble) == ((ROW,), "interrupted")
    patience = time.monotonic() + 20
    while is_running(int(up.read_text())):
        assert time.monotonic() < patience, "its child is still there"
        time.sleep(0.01)


def once_more(wait: Callable[..., int]) -> Callable[..., int]:
    """Whose first call is interrupted."""
    calls = []

    def called(*words: float) -> int:
        calls.append(words)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return wait(*words)

    return called


@pytest.mark.thorough
def test_a_part_that_fails_leaves_the_others(folder: Path) -> None:
    text = """
from benchmarks.ledger.row import attempt, plan, rate_row, report
one, two, three = (rate_row(name, "1/s", []) for name in "abc")
plan(one, two, three)
with attempt(one, two):
    report(rate_row("a", "1/s", [1]))
    int("x")
with attempt(three):
    report(rate_row("c", "1/s", [3]))
"""
    (folder / "bench_a.py").write_text(f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{text}")
    bench = run(folder / "bench_a.py", 60)
    why = "ValueError: invalid literal for int() with base 10: 'x'"
    expected = [((1.0,), ""), ((), why), ((3.0,), "")]
    assert ([(row.ours, row.note) for row in bench.rows], bench.failed) == (expected, False)


@pytest.mark.thorough
def test_one_without_rows_has_a_row_that_says_why(folder: Path) -> None:
    (folder / "bench_a.py").write_text("import time; time.sleep(999)")
    assert run(folder / "bench_a.py", 0.1).rows == (Row("bench_a", "", note="did not end in 0.1 s, and was ended"),)


def test_all_stay_below_ten_minutes_even_if_some_have_to_be_ended() -> None:
    assert SECONDS.keys() == {script.stem for script in scripts(ROOT)}
    assert sum(SECONDS.values()) + 5 * GRACE < 600


def test_its_variables_are_not_ours(folder: Path) -> None:
    (folder / "bench_a.py").write_text("")
    run(folder / "bench_a.py", 60)
    assert "DODO_BENCH_ROWS" not in os.environ
