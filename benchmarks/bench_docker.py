"""Closed-loop tests on the docker backend beside ``docker compose up`` and ``down`` of the same files.

First one test: what ``dodo run`` takes beyond compose, command and report included. Then several at once, beside
compose one after the other. Both drive the same cars for the same time. The images must exist (``dodo images build``).
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import IMAGES, ROOT, engine_problem, finished

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report

TESTS = ("sil-closed-straight", "sil-closed-left-curve")
ROUNDS = 3
COMPOSE = "docker compose up, down"
BEYOND, AT_ONCE = "docker test, beyond compose up and down", f"{len(TESTS)} docker tests at once"


def seconds(*commands: Sequence[str], folder: Path) -> float:
    start = time.perf_counter()
    for command in commands:
        if code := finished(command, folder):
            raise RuntimeError(f"{' '.join(command)} ended with {code}")
    return time.perf_counter() - start


def ours(tests: Sequence[str], folder: Path) -> float:
    words = ["--backend", "docker", "-j", str(len(tests)), "--report", str(folder / "report")]
    return seconds([sys.executable, "-m", "dodo_dsl", "run", *tests, *words], folder=ROOT)


def theirs(tests: Sequence[str], folder: Path) -> float:
    """One after the other."""
    up = ["docker", "compose", "up", "--exit-code-from", "track"]
    down = ["docker", "compose", "down", "-v"]
    try:
        return sum(seconds(up, down, folder=folder / "generated" / test) for test in tests)
    except BaseException:
        for test in tests:
            finished([*down, "--timeout", "0"], folder / "generated" / test)
        raise


def rounds(tests: Sequence[str], folder: Path, budget: Budget, until: float) -> tuple[list[float], list[float]]:
    """Seconds of both, in turns, reported after each round."""
    found: tuple[list[float], list[float]] = [], []
    for number in budget.rounds(ROUNDS, until):
        ways = list(zip(found, (ours, theirs), strict=True))
        for times, way in ways if number % 2 else reversed(ways):
            times.append(way(tests, folder))
        report(*rows(tests, *found))
    return found


def rows(tests: Sequence[str], own: list[float], other: list[float]) -> list[Row]:
    if len(tests) > 1:
        return [cost_row(AT_ONCE, "s", own, f"{COMPOSE}, one by one", other)]
    beyond = [a - b for a, b in zip(own, other, strict=True)]
    return [
        cost_row("docker test, command to end", "s", own, COMPOSE, other),
        cost_row(BEYOND, "s", beyond, goal=Goal(1, of="value")),
    ]


def main() -> int:
    planned = [*rows(TESTS[:1], [], []), *rows(TESTS, [], [])]
    if problem := engine_problem(IMAGES):
        plan(*planned, note=problem)
        print(f"{problem}: nothing to measure")
        return 0
    budget = Budget.given()
    plan(*planned)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        compiled = [sys.executable, "-m", "dodo_dsl", "compile", *TESTS, "-o", str(folder / "generated")]
        seconds(compiled, folder=ROOT)
        longest = 0.0
        for tests, until in ((TESTS[:1], 0.7), (TESTS, 1.0)):
            if budget.left() < longest * len(tests):
                continue
            with attempt(*rows(tests, [], [])):
                own, other = rounds(tests, folder, budget, until)
                longest = max(map(sum, zip(own, other, strict=True)))
                medians = f"{statistics.median(own):5.1f} s, {COMPOSE} {statistics.median(other):5.1f} s"
                print(f"{len(tests)} at once: dodo run --backend docker {medians}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
