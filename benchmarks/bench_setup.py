"""How soon a test runs on each backend, beside ``docker compose up -d`` of its compiled files.

Ours is the set-up that the report states: from the test's turn until every service is ready and the application starts
to be judged. Compose's ends when the containers run, ready or not. In turns, one test at a time; DoDo's images must
exist (``dodo images build``), and the application's are built before.
"""

import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import IMAGES, ROOT, engine_problem, finished

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report

TEST = "sil-closed-straight"
ROUNDS = 5
COMPOSE = "docker compose up -d"
WAYS = ("process", "mixed", "docker")


def ours(backend: str, folder: Path) -> float:
    """Seconds of set-up, as the report says."""
    place = folder / backend
    words = ["run", TEST, "--backend", backend, "--report", str(place), "-q"]
    if code := finished([sys.executable, "-m", "dodo_dsl", *words], ROOT):
        raise RuntimeError(f"dodo {' '.join(words)} ended with {code}")
    (test,) = json.loads((place / "results.json").read_text())["tests"]
    return float(test["setup_s"])


def theirs(folder: Path) -> float:
    start = time.perf_counter()
    try:
        code = finished([*COMPOSE.split()], folder)
        seconds = time.perf_counter() - start
    finally:  # also if this benchmark's time is over
        finished(["docker", "compose", "down", "-v", "--timeout", "0"], folder)
    if code:
        raise RuntimeError(f"{COMPOSE} ended with {code}")
    return seconds


def rows(found: dict[str, list[float]]) -> list[Row]:
    """Of the rounds that both sides of a row have."""
    return [
        *(_row(f"set-up, {way}", found[way], COMPOSE, found[COMPOSE]) for way in WAYS),
        _row("set-up, mixed, beside docker", found["mixed"], "set-up, docker", found["docker"], Goal(1)),
    ]


def _row(what: str, own: list[float], peer: str, theirs: list[float], goal: Goal | None = None) -> Row:
    both = min(len(own), len(theirs))
    return cost_row(what, "s", own[: both or None], peer if both else "", theirs[:both], goal=goal)


def main() -> int:
    found: dict[str, list[float]] = {way: [] for way in (*WAYS, COMPOSE)}
    budget = Budget.given()
    plan(*rows(found))
    ways = [*WAYS, COMPOSE]
    if problem := engine_problem(IMAGES):
        plan(*rows(found), note=problem)
        ways = ["process"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        compiled = [sys.executable, "-m", "dodo_dsl", "compile", TEST, "-o", str(folder / "generated")]
        if code := finished(compiled, ROOT):
            raise RuntimeError(f"dodo compile ended with {code}")
        if not problem:
            with attempt():
                ours("docker", folder)  # builds the application's images
        for number in budget.rounds(ROUNDS):
            for way in list(ways if number % 2 else reversed(ways)):
                try:
                    found[way].append(theirs(folder / "generated" / TEST) if way == COMPOSE else ours(way, folder))
                except RuntimeError as error:
                    problem = str(error)
                    ways.remove(way)
            report(*(replace(row, note="" if row.theirs else problem) for row in rows(found)))
    for way, times in found.items():
        print(f"{way}: {', '.join(f'{seconds:.2f}' for seconds in sorted(times))} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
