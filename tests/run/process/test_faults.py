"""Faults around tests of the process backend: the outcome, its sentence, nothing left, and an unharmed neighbour."""

import re
import time
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.run import engine
from tests.faults import Book
from tests.run.faults import Fault, as_told, faults_on, whole_logs
from tests.run.helpers import STARTED, WAIT, Bench

pytestmark = pytest.mark.slow


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """On the host, where more can be left than in namespaces."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return Bench(tmp_path, "host")


def run_all(bench: Bench, faults: dict[str, Fault]) -> dict[str, Outcome]:
    """The outcomes of all faults at once, each a test."""
    plans = [
        bench.plan(f.judge, STARTED + f.application, f.environment, slug=slug, timeout_s=30.0)
        for slug, f in faults.items()
    ]
    return {outcome.slug: outcome for outcome in bench.run(*plans, parallel=len(plans))}


def nothing_left(bench: Bench) -> None:
    """No process of these scripts, no lease and no shared memory that they made."""
    logs = "".join(p.read_text()[:1000] for p in bench.folder.glob("report/*/logs/application.app.log"))
    memories = re.findall(r"^memory (\S+)$", logs, re.MULTILINE)
    assert memories
    assert [name for name in memories if Path("/tmp", name).exists()] == []
    assert list((bench.folder / "leases").glob("*.json")) == []
    deadline = time.monotonic() + 5
    while left := scripts_running(bench.folder):
        assert time.monotonic() < deadline, left
        time.sleep(0.05)


def scripts_running(folder: Path) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            text = path.read_bytes()
        except OSError:
            continue
        if f"{folder}/".encode() in text and b".py\0" in text:
            found.append(text.replace(b"\0", b" ").decode())
    return found


@pytest.mark.parametrize("faults", faults_on("process"))
def test_faults_at_once(faults: dict[str, Fault], bench: Bench, book: Book) -> None:
    outcomes = run_all(bench, faults)
    as_told(faults, outcomes, "process", book)
    nothing_left(bench)
    report = bench.folder / "report"
    whole_logs(faults, lambda slug: (report / slug / "logs" / "application.app.log").read_text())


def test_service_that_never_gets_ready(bench: Bench, book: Book, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "READY_PATIENCE_S", 0.5)
    (late,) = bench.run(bench.plan(environment=WAIT))
    assert (late.outcome, late.reason) == ("error", "service 'camera' was not ready within 0.5 s")
    assert list((bench.folder / "leases").glob("*.json")) == []
    book.record("A service never gets ready", "process", late.outcome, late.reason)
