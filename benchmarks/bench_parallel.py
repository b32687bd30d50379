"""Tests at once against one after the other, in lockstep and in real time: python benchmarks/bench_parallel.py [TESTS].

Closed loops with images of 320x240 at 10 Hz and the example application, on the process backend. Prints how long both
ways take, and their ratio: with N tests in real time, N times as fast is the most that there can be; in lockstep, as
many times as there are cores. All of them have to pass.
"""

import json
import os
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, finished

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report

CORES = len(os.sched_getaffinity(0))
TESTS, FEWER, ROUNDS = 8, 3, 3
OF_A_CORE = 0.9
SMALL = {"width: 640": "width: 320", "height: 480": "height: 240"}


def small(folder: Path, tests: int) -> None:
    """A repository with so many instances of a closed loop with small images."""
    shutil.copytree(ROOT / "tests_registry" / "maps", folder / "tests" / "maps")
    shutil.copytree(ROOT / "examples" / "kiwi", folder / "app")
    spec = (ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml").read_text()
    for large, less in {**SMALL, "sil-closed-straight": "small", "z: 9.5 cm": "z: 9.5 cm, seed: '${matrix.n}'"}.items():
        spec = spec.replace(large, less)
    numbers = ", ".join(map(str, range(1, tests + 1)))
    path = folder / "tests" / "small" / "small.dodo.yml"
    path.parent.mkdir()
    path.write_text(f"{spec}matrix: {{n: [{numbers}]}}\n")
    compose = folder / "app" / "docker-compose.yml"
    compose.write_text(compose.read_text().replace("--width=640 --height=480", "--width=320 --height=240"))
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: app/docker-compose.yml\n")


def run(folder: Path, clock: str, tests: int, jobs: int) -> float:
    """Seconds of ``dodo run`` with so many jobs; raises RuntimeError when a test does not pass."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DODO_HISTORY": str(folder / "history.jsonl")}
    names = [f"small[n={number}]" for number in range(1, tests + 1)]
    command = [sys.executable, "-m", "dodo_dsl", "run", *names, "--clock", clock, "-j", str(jobs)]
    began = time.monotonic()
    finished(command, folder, environment)
    took = time.monotonic() - began
    found = json.loads((folder / "dodo-report" / "results.json").read_text())["tests"]
    wrong = [f"{t['slug']}: {t['reason']}" for t in found if t["outcome"] != "passed"]
    times = [t["execution_s"] for t in found]
    print(f"{clock}, {jobs} at once: {took:.1f} s, each {min(times):.2f} to {max(times):.2f} s")
    if wrong:
        raise RuntimeError(f"not passed: {'; '.join(wrong)}")
    return took


def rounds(folder: Path, clock: str, tests: int, budget: Budget, until: float) -> Row:
    """Both ways in turns."""
    together: list[float] = []
    alone: list[float] = []
    for number in budget.rounds(ROUNDS, until):
        ways = ((together, CORES if clock == "lockstep" else tests), (alone, 1))
        for times, jobs in ways if number % 2 else reversed(ways):
            times.append(run(folder, clock, tests, jobs))
        report(row_of(clock, tests, together, alone))
    return row_of(clock, tests, together, alone)


def row_of(clock: str, tests: int, together: list[float], alone: list[float]) -> Row:
    goal = Goal(OF_A_CORE * CORES) if clock == "lockstep" else None
    return cost_row(f"{tests} tests at once, {clock}", "s", together, "one after the other", alone, goal=goal)


def main() -> int:
    budget = Budget.given()
    tests = int(sys.argv[1]) if len(sys.argv) > 1 else TESTS
    plan(row_of("lockstep", tests, [], []), row_of("realtime", FEWER if budget.limited else tests, [], []))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        small(folder, tests)
        for clock, number, until in (("lockstep", tests, 0.6), ("realtime", FEWER if budget.limited else tests, 1.0)):
            with attempt(row_of(clock, number, [], [])):
                row = rounds(folder, clock, number, budget, until)
                times = statistics.median(row.ratios)
                print(f"{row.what}: {times:.2f} times as fast as one after the other, {CORES} cores")
    return 0


if __name__ == "__main__":
    sys.exit(main())
