"""Faults around tests in containers: the outcome, its sentence, nothing left, and an unharmed neighbour."""

import os
import re
import secrets
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.run import engine
from dodo_dsl.run.backends import Job
from tests.docker.broken_registry import TRIES, BrokenRegistry
from tests.docker.compose import Crate
from tests.docker.engine_proxy import EngineProxy, engine_socket
from tests.faults import Book
from tests.run.desk import ROOT, wait_for
from tests.run.helpers import DRIVES, READY, WAIT, Bench
from tests.run.test_faults import FAULTS, NEIGHBOUR

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("images")]

HUNGRY = """
held = []
time.sleep(1)
while True:
    held.append(bytearray(os.urandom(1000)) * 4000)
"""
MISSING = "127.0.0.1:9/dodo-no-such-image:1"
SCRIPTED = {slug: fault for slug, fault in FAULTS.items() if fault is not NEIGHBOUR}
KINDS = {
    "missing": ("An image is missing", "error", f"image {MISSING} cannot be pulled: "),
    "hungry": (
        "The application takes more memory than it may",
        "failed",
        "application service 'app' ran out of memory after ",
    ),
    **{slug: (fault.name, fault.outcome, fault.sentence) for slug, fault in SCRIPTED.items()},
}


@pytest.fixture
def crate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Crate]:
    """Tests with a mark of their own; nothing of them is left at the end."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    made = new_crate(tmp_path)
    yield made
    assert made.left() == []


def new_crate(folder: Path) -> Crate:
    folder.chmod(0o777)
    return Crate(Bench(folder), f"fault-{secrets.token_hex(3)}")


def start(crate: Crate, job: Job, **variables: str) -> "subprocess.Popen[str]":
    words = ["run", "--backend", "docker", "--compiled", str(job.folder), "--report", str(job.report.parent)]
    return subprocess.Popen(
        [sys.executable, "-m", "dodo_dsl", *words],
        cwd=ROOT,
        env={**os.environ, "DODO_LEASES": str(crate.bench.folder / "leases"), **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.fixture(scope="module", autouse=True)
def broken_pull(tmp_path_factory: pytest.TempPathFactory, images: None) -> Iterator["subprocess.Popen[str]"]:
    """A run whose image never arrives: the engine tries for more than a minute, while the other tests go on."""
    crate = new_crate(tmp_path_factory.mktemp("broken"))
    with BrokenRegistry() as registry:
        process = start(crate, crate.job("pull", image=registry.image))
        yield process
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert crate.left() == []


def told(process: "subprocess.Popen[str]", result: str) -> str:
    """The reason in the last lines of a run of one test."""
    out, _ = process.communicate(timeout=200)
    assert "Traceback" not in out
    (reason,) = re.findall(rf"^{result} +\S+  (.*?)(?: \(set-up .*\))?$", out, re.MULTILINE)
    return str(reason)


def test_faults_at_once(crate: Crate, book: Book) -> None:
    jobs = [crate.job(slug, f.judge, f.application, f.environment) for slug, f in FAULTS.items()]
    jobs.append(crate.job("hungry", application=HUNGRY, mem_limit="64m", memswap_limit="64m"))
    jobs.append(crate.job("missing", image=MISSING))
    outcomes = crate.run(*jobs)
    assert outcomes["neighbour"].outcome == "passed", outcomes["neighbour"].reason
    for slug, (_, outcome, sentence) in KINDS.items():
        assert (outcomes[slug].outcome, outcomes[slug].reason[: len(sentence)]) == (outcome, sentence)
    numbers = crate.log("many-lines").split("\n")[:-1]
    assert len(numbers) > 10_000
    assert numbers == [str(n) for n in range(len(numbers))]
    said = crate.log("long-line")
    assert (len(said), said[-7:]) == (5_000_007, "\nafter\n")
    for slug, (name, *_) in KINDS.items():
        book.record(name, "docker", outcomes[slug].outcome, outcomes[slug].reason)


def test_service_that_never_gets_ready(crate: Crate, book: Book, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "READY_PATIENCE_S", 2.0)
    (outcome,) = crate.run(crate.job("never-ready", environment=WAIT)).values()
    assert outcome.reason == "service 'camera' was not ready within 2 s"
    book.record("A service never gets ready", "docker", outcome.outcome, outcome.reason)


def test_disk_with_the_report_is_full(crate: Crate, small_disk: Path, book: Book) -> None:
    """A recording that does not fit stays behind with its volume's other files, and the volume goes."""
    writes = 'open("/dodo/report/test.rec", "wb").write(bytes(200_000))\n'
    job = crate.job("full", judge=DRIVES, environment=writes + READY + WAIT, report=small_disk)
    run = start(crate, job)
    out = wait_for(run, "the report misses files of camera: No space left on device")
    rest, _ = run.communicate(timeout=60)
    assert run.returncode == 3, out + rest
    (unwritten,) = re.findall(rf"^'{small_disk}' (cannot take the whole report: .*)$", rest, re.MULTILINE)
    (reason,) = re.findall(r"^PASSED +\S+  (.*?) \(set-up", rest, re.MULTILINE)
    book.record("The disk with the report is full", "docker", "passed", f"{reason}; 'dodo-report' {unwritten}")


def test_engine_that_goes_away(crate: Crate, book: Book) -> None:
    """To this run it has gone; what the run cannot take down any more, the next one does."""
    socket = engine_socket()
    if socket is None:
        pytest.skip("the engine is not reached by a socket of this machine")
    job = crate.job("cut")
    with EngineProxy(socket, crate.bench.folder / "engine.sock") as proxy:
        run = start(crate, job, **proxy.variables)
        wait_for(run, "running")
        neighbour = start(crate, crate.job("beside", judge=DRIVES))
        wait_for(neighbour, "running")
        proxy.cut()
        reason = told(run, "ERROR")
    assert run.returncode == 3
    assert told(neighbour, "PASSED") == "it drove"
    left = crate.left()
    assert len([name for name in left if f"-{job.plan.slug}-" in name]) > 4
    second = start(crate, crate.job("again", judge=DRIVES))
    said = wait_for(second, "removed what a killed run left: ")
    assert f"{job.plan.slug}: 7 containers, networks and volumes" in said
    assert told(second, "PASSED") == "it drove"
    book.record("The engine goes away in the middle of a test", "docker", "error", reason)


def test_runner_that_is_killed(crate: Crate, book: Book) -> None:
    job = crate.job("killed")
    run = start(crate, job)
    wait_for(run, "running")
    run.kill()
    run.communicate()
    assert len(crate.left()) > 4
    second = start(crate, crate.job("again", judge=DRIVES))
    said = wait_for(second, "removed what a killed run left: ")
    assert told(second, "PASSED") == "it drove"
    note = said.splitlines()[-1].replace(job.plan.slug, "test")
    book.record("The runner is killed, and run again", "docker", "passed", note)


def test_two_runners_at_once(crate: Crate, book: Book) -> None:
    """Both begin with the same subnet, and one leaves it to the other."""
    runs = [start(crate, crate.job(f"run-{n}", judge=DRIVES)) for n in range(2)]
    for run in runs:
        book.record("Two runners at once", "docker", "passed", told(run, "PASSED"))


def test_interrupt_does_not_wait_for_a_pull(crate: Crate) -> None:
    with BrokenRegistry() as registry:
        run = start(crate, crate.job("interrupted", image=registry.image))
        wait_for(run, "the connection broke")
        run.send_signal(signal.SIGINT)
        assert told(run, "ERROR") == "the run was interrupted"
        assert registry.breaks < TRIES
    assert run.returncode == 130


def test_pull_that_breaks(broken_pull: "subprocess.Popen[str]", book: Book) -> None:
    out = wait_for(broken_pull, "the connection broke, the engine tries again")
    assert "pulling 127.0.0.1:" in out
    book.record("The connection breaks in the middle of a pull", "docker", "error", told(broken_pull, "ERROR"))
    assert broken_pull.returncode == 3
