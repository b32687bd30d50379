"""Compiling and checking 10 to 10,000 instances, beside ``docker compose config -q`` on the output.

Each number of instances is compiled twice: by a matrix, and as as many specs; 10,000 only by matrices, of five specs.
The seconds a test include the start of the command. Everything is written below the system's temporary folder, so its
file system has a share in the figures; ``--check`` writes nothing.
"""

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, cost_of

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report
from dodo_dsl.spec.matrix import MAX_INSTANCES

PLUGINS = (Path.home() / ".docker", Path("/usr/local/lib/docker"), Path("/usr/libexec/docker"), Path("/usr/lib/docker"))
PLUGIN = next((path for folder in PLUGINS if (path := folder / "cli-plugins" / "docker-compose").is_file()), None)
NO_PEER = "Compose v2 is not installed: no peer to measure against"
SPEC = ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml"
CASES = ((100, True, 0.25), (100, False, 0.4), (1000, True, 0.8), (10, True, 0.85), (10, False, 0.9),
         (1000, False, 1.0), (10_000, True, 1.0))  # fmt: skip
"""Instances, whether of a matrix, and the part of the budget by which they are done."""
ROUNDS = 5
PEER_CALLS = 10


class Call(NamedTuple):
    """Seconds to check and to compile, peak memory in MiB, and seconds that the peer takes for a test."""

    check: float
    write: float
    peak: float
    peer: float


def write_specs(folder: Path, name: str, number: int, matrix: bool) -> None:
    """A registry of so many instances; each has its own yaw, within the range that the spec varies it in."""
    yaws = [f"{66 + 8 * i / number:.6f} deg" for i in range(number)]
    text = SPEC.read_text()
    size = MAX_INSTANCES if matrix else 1
    parts = [yaws[first : first + size] for first in range(0, number, size)]
    bodies = [text.replace("70 deg", '"${matrix.yaw}"' if matrix else yaw) for yaw, *_ in parts]
    bodies = (
        [f"{b}matrix: {{yaw: [{', '.join(p)}]}}\n" for b, p in zip(bodies, parts, strict=True)] if matrix else bodies
    )
    specs = {f"{name}-{number}": body for number, body in enumerate(bodies)}
    for spec, body in specs.items():
        path = folder / "tests" / spec / f"{spec}.dodo.yml"
        path.parent.mkdir(parents=True)
        path.write_text(body.replace("name: sil-closed-straight", f"name: {spec}"))
    shutil.copytree(ROOT / "tests_registry" / "maps", folder / "tests" / "maps")
    shutil.copytree(ROOT / "examples" / "kiwi", folder / "kiwi")
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: kiwi/docker-compose.yml\n")


def dodo(folder: Path, *words: str) -> tuple[float, float]:
    """Seconds of one cold call, and its peak memory in MiB."""
    return cost_of([sys.executable, "-m", "dodo_dsl", *words], folder)[:2]


def peer(folder: Path) -> float:
    """Seconds that compose takes to check one compiled test; 0 if there is no compose."""
    if PLUGIN is None:
        return 0.0
    tests = sorted(p.parent for p in (folder / "generated").glob("*/test.json"))[:PEER_CALLS]
    start = time.perf_counter()
    for test in tests:
        subprocess.run([PLUGIN, "config", "-q"], cwd=test, check=True)
    return (time.perf_counter() - start) / len(tests)


def measure(number: int, matrix: bool, budget: Budget, until: float) -> list[Call]:
    """Rounds of one case, reported after each."""
    calls = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_specs(folder, "bench", number, matrix)
        for _ in budget.rounds(ROUNDS if number <= 1000 else 1, until):
            shutil.rmtree(folder / "generated", ignore_errors=True)
            check = dodo(folder, "compile", "--check", "-o", "absent")[0]
            write, peak = dodo(folder, "compile")
            calls.append(Call(check, write, peak, peer(folder)))
            report(*rows(number, matrix, calls))
    return calls


def rows(number: int, matrix: bool, calls: Sequence[Call]) -> list[Row]:
    kind, checks, writes = f"{number:,} {kind_of(matrix)}", [c.check for c in calls], [c.write for c in calls]
    theirs = [c.peer * 1000 for c in calls]
    rest: dict[str, Any] = {"peer": "compose config", "theirs": theirs} if PLUGIN else {"note": NO_PEER}
    goal = Goal(20) if number >= 100 else None
    found = [
        cost_row(f"{verb} a test, {kind}", "ms", [1000 * value / number for value in values], goal=goal, **rest)
        for verb, values in (("check", checks), ("compile", writes))
    ]
    return [*found, cost_row(f"compile, peak memory, {kind}", "MiB", [c.peak for c in calls])]


def kind_of(matrix: bool) -> str:
    return "of a matrix" if matrix else "specs"


def show(number: int, matrix: bool, calls: Sequence[Call]) -> None:
    check, write, peak, other = (statistics.median(column) for column in zip(*calls, strict=True))
    ratios = f"{other * number / check:6.1f} {other * number / write:6.1f}" if other else NO_PEER
    print(f"{number:6d} {kind_of(matrix):11s} {check:6.2f} s  {write:6.2f} s   {peak:6.0f} MiB"
          f"  {other * 1000:6.1f} ms   {ratios}")  # fmt: skip


def main() -> int:
    budget = Budget.given()
    print("instances          check    compile     peak    peer a test   times as fast a test: check, compile")
    plan(*(row for number, matrix, _ in CASES for row in rows(number, matrix, [])))
    each = 0.0
    for number, matrix, until in CASES:
        if budget.left() < each * number:
            continue
        begin = time.perf_counter()
        with attempt(*rows(number, matrix, [])):
            calls = measure(number, matrix, budget, until)
            each = (time.perf_counter() - begin) / len(calls) / number
            show(number, matrix, calls)
    return 0


if __name__ == "__main__":
    sys.exit(main())
