"""Every fault against every shipped sil and dil test, kept in a file as it goes, so that an interrupted run goes on."""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

import yaml

from dodo_dsl.atomic import write_text

ROOT = Path(__file__).resolve().parents[2]
APPLICATION = Path(__file__).with_name("docker-compose.yml")
OUTCOMES = 0, 1, 3
"""Exit codes of ``dodo run`` with an outcome of every test."""


@dataclass(frozen=True)
class ShippedTest:
    """An instance of a shipped test; ``digest`` is of its spec: with another one it has to run again."""

    slug: str
    kind: str
    digest: str


@dataclass(frozen=True)
class Cell:
    """What became of one fault in one test."""

    outcome: str
    reason: str
    digest: str


Cells = dict[str, dict[str, Cell]]
"""By fault, then by test."""


def shipped_tests() -> list[ShippedTest]:
    """The shipped tests of the levels sil and dil."""
    listed = json.loads(_dodo("list", "--json").stdout)
    return [
        ShippedTest(test["slug"], test["kind"], _digest(ROOT / test["file"]))
        for test in listed
        if test["level"] in {"sil", "dil"}
    ]


def _digest(spec: Path) -> str:
    """Of all that a spec says but for its clock, as the clock is chosen here."""
    said = yaml.safe_load(spec.read_text(encoding="utf-8"))
    said.pop("clock", None)
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:12]


def outcomes_of(fault: str, slugs: Iterable[str], report: Path, jobs: int = 1) -> dict[str, tuple[str, str]]:
    """Outcome and reason of each test, as ``dodo run`` reports them; raises RuntimeError where it did not run."""
    words = ("--clock", "lockstep", "--application", str(APPLICATION), "--report", str(report), "--jobs", str(jobs))
    result = _dodo("run", *slugs, *words, fault=fault)
    if result.returncode not in OUTCOMES:
        raise RuntimeError(f"{fault}: dodo run ended with exit code {result.returncode}: {result.stderr}")
    tests = json.loads((report / "results.json").read_text())["tests"]
    return {test["slug"]: (test["outcome"], test["reason"]) for test in tests}


def _dodo(*words: str, fault: str = "") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "dodo_dsl", *words]
    environment = {**os.environ, "FAULT": fault}
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)


class Kept:
    """Finished cells in a JSON file, written after each fault."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cells: Cells = {}
        self._lock = threading.Lock()
        if path.is_file():
            kept = json.loads(path.read_text())
            self.cells = {f: {slug: Cell(**cell) for slug, cell in row.items()} for f, row in kept.items()}

    def missing(self, fault: str, tests: Sequence[ShippedTest]) -> list[ShippedTest]:
        """Tests of a fault that did not run yet, or with another spec."""
        row = self.cells.get(fault, {})
        return [test for test in tests if test.slug not in row or row[test.slug].digest != test.digest]

    def add(self, fault: str, cells: dict[str, Cell]) -> None:
        with self._lock:
            self.cells.setdefault(fault, {}).update(cells)
            self.path.parent.mkdir(parents=True, exist_ok=True)
            rows = {f: {slug: asdict(cell) for slug, cell in row.items()} for f, row in self.cells.items()}
            write_text(self.path, json.dumps(rows, indent=1))


def run(kept: Kept, wanted: Mapping[str, Sequence[ShippedTest]], jobs: int, say: Callable[[str], None]) -> None:
    """Run what is missing of the tests of each fault, so many faults at a time; raises RuntimeError."""
    todo = {fault: missing for fault, tests in wanted.items() if (missing := kept.missing(fault, tests))}
    say(f"{sum(map(len, todo.values()))} tests of {len(todo)} faults to run, {jobs} at a time")
    with ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(_cells, fault, missing): fault for fault, missing in todo.items()}
        try:
            for number, done in enumerate(as_completed(running), 1):
                fault, cells = running[done], done.result()
                kept.add(fault, cells)
                caught = sum(cell.outcome == "failed" for cell in cells.values())
                say(f"[{number} of {len(todo)}] {fault}: {caught} of {len(cells)} tests failed")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _cells(fault: str, tests: Sequence[ShippedTest]) -> dict[str, Cell]:
    digests = {test.slug: test.digest for test in tests}
    with tempfile.TemporaryDirectory(prefix="kill-") as folder:
        found = outcomes_of(fault, digests, Path(folder) / "report")
    return {slug: Cell(*found[slug], digests[slug]) for slug in digests}
