"""How soon a test runs on each backend, beside ``docker compose up -d`` of its compiled files.

Ours is the set-up that the report states: from the test's turn until every service is ready and the application starts
to be judged. Compose's ends when the containers run, ready or not. In turns, one test at a time; DoDo's images must
exist (``dodo images build``), and the application's are built before.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, finished

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, cost_row, plan, report

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
    code = finished([*COMPOSE.split()], folder)
    seconds = time.perf_counter() - start
    finished(["docker", "compose", "down", "-v", "--timeout", "0"], folder)
    if code:
        raise RuntimeError(f"{COMPOSE} ended with {code}")
    return seconds


def rows(found: dict[str, list[float]]) -> list[Row]:
    compared = [cost_row(f"set-up, {way}", "s", found[way], COMPOSE, found[COMPOSE]) for way in WAYS]
    mixed = cost_row(
        "set-up, mixed, beside docker", "s", found["mixed"], "set-up, docker", found["docker"], goal=Goal(1)
    )
    return [*compared, mixed]


def main() -> int:
    found: dict[str, list[float]] = {way: [] for way in (*WAYS, COMPOSE)}
    if (
        shutil.which("docker") is None
        or subprocess.run(["docker", "info"], capture_output=True, check=False).returncode
    ):
        note = "no Docker engine answers: nothing to measure"
        plan(*rows(found), note=note)
        print(note)
        return 0
    budget = Budget.given()
    plan(*rows(found))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        compiled = [sys.executable, "-m", "dodo_dsl", "compile", TEST, "-o", str(folder / "generated")]
        if code := finished(compiled, ROOT):
            raise RuntimeError(f"dodo compile ended with {code}")
        ours("docker", folder)  # builds the application's images
        for number in budget.rounds(ROUNDS):
            order = [*WAYS, COMPOSE]
            for way in order if number % 2 else reversed(order):
                found[way].append(theirs(folder / "generated" / TEST) if way == COMPOSE else ours(way, folder))
            report(*rows(found))
    for way, times in found.items():
        print(f"{way}: {', '.join(f'{seconds:.2f}' for seconds in sorted(times))} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
