"""Faults around tests of the process backend: the outcome, its sentence, nothing left, and an unharmed neighbour."""

import re
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.run import engine
from tests.faults import Book
from tests.run.helpers import BEGUN, DRIVES, FAIL, PASS, READY, STARTED, WAIT, Bench

pytestmark = pytest.mark.slow
SHARES = """
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory
name = sys.argv[2].partition("=")[2]
memory = SharedMemory.create(name, 1000)
print("memory", name, flush=True)
"""
MAYBE = """print('{"dodo": "verdict", "outcome": "maybe"}', flush=True)\n"""
LINES_A_SECOND = """
count, begin = 0, time.monotonic()
while True:
    due = int(10_000 * (time.monotonic() - begin))
    sys.stdout.write("".join(f"{n}\\n" for n in range(count, due)))
    sys.stdout.flush()
    count = due
    time.sleep(0.01)
"""
LONG_LINE = 'print("x" * 5_000_000, flush=True)\n'


@dataclass(frozen=True)
class Fault:
    """Scripts that cause a fault, and how the sentence about it begins; ``name`` is the one on the page."""

    name: str
    outcome: str
    sentence: str
    judge: str = READY + WAIT
    application: str = WAIT
    environment: str = READY + WAIT


NEIGHBOUR = Fault("", "passed", "it drove", judge=DRIVES, application=SHARES + WAIT)
FAULTS = {
    "neighbour": NEIGHBOUR,
    "killed": Fault(
        "The application is killed",
        "failed",
        "application service 'app' was killed by SIGKILL after",
        application=SHARES + "time.sleep(0.5)\nos.kill(os.getpid(), 9)",
    ),
    "service-killed": Fault(
        "A service of DoDo's is killed",
        "error",
        "service 'camera' of layer environment was killed by SIGKILL after",
        environment=READY + BEGUN + "os.kill(os.getpid(), 9)",
    ),
    "no-verdict": Fault(
        "An evaluator ends without a verdict",
        "error",
        "evaluator 'judge' ended without a verdict after",
        judge=READY + BEGUN,
    ),
    "two-verdicts": Fault(
        "An evaluator gives two verdicts",
        "error",
        "evaluator 'judge' gave 2 verdicts, expected one",
        judge=READY + BEGUN + PASS + FAIL,
    ),
    "malformed": Fault(
        "An evaluator gives a malformed verdict",
        "error",
        "the verdict of evaluator 'judge' is malformed: its outcome is \"maybe\", expected passed or failed",
        judge=READY + BEGUN + MAYBE + WAIT,
    ),
    "many-lines": Fault(
        "The application logs 10,000 lines a second",
        "passed",
        "it drove",
        judge=READY + BEGUN + "time.sleep(2)\n" + PASS,
        application=LINES_A_SECOND,
    ),
    "long-line": Fault(
        "The application logs a line of 5 MB",
        "passed",
        "it drove",
        judge=READY + LONG_LINE + BEGUN + PASS,
        application=LONG_LINE + 'print("after")\n' + WAIT,
    ),
}


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


def test_faults_at_once(bench: Bench, book: Book) -> None:
    outcomes = run_all(bench, FAULTS)
    for slug, fault in FAULTS.items():
        outcome = outcomes[slug]
        assert (outcome.outcome, outcome.reason[: len(fault.sentence)]) == (fault.outcome, fault.sentence), slug
    nothing_left(bench)
    report = bench.folder / "report"
    numbers = (report / "many-lines" / "logs" / "application.app.log").read_text().split("\n")[:-1]
    assert len(numbers) > 10_000
    assert numbers == [str(n) for n in range(len(numbers))]
    said = (report / "long-line" / "logs" / "application.app.log").read_text()
    assert (len(said), said[-7:]) == (5_000_007, "\nafter\n")
    for slug, fault in FAULTS.items():
        if fault is not NEIGHBOUR:
            book.record(fault.name, "process", outcomes[slug].outcome, outcomes[slug].reason)


def test_service_that_never_gets_ready(bench: Bench, book: Book, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "READY_PATIENCE_S", 0.5)
    (late,) = bench.run(bench.plan(environment=WAIT))
    assert (late.outcome, late.reason) == ("error", "service 'camera' was not ready within 0.5 s")
    assert list((bench.folder / "leases").glob("*.json")) == []
    book.record("A service never gets ready", "process", late.outcome, late.reason)
