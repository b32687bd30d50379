"""Faults around runs with containers: of disk, engine and runner."""

import re
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from dodo_dsl.run import capabilities, work_folder
from tests.docker.compose import IMAGE, Crate
from tests.docker.engine_proxy import EngineProxy, engine_socket
from tests.faults import Book
from tests.run.desk import wait_for
from tests.run.helpers import BEGUN, DRIVES, PASS, READY, WAIT

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def told(process: "subprocess.Popen[str]", result: str) -> str:
    """The reason in the last lines of a run of one test."""
    assert process.stdout is not None
    with process.stdout as stream:  # lines that came before may still be in its buffer, which communicate() passes over
        out = stream.read()
    process.wait(timeout=600)
    assert "Traceback" not in out
    (reason,) = re.findall(rf"^{result} +\S+  (?:.* s  )?(.*?)(?: \(set-up .*\))?$", out, re.MULTILINE)
    return str(reason)


@pytest.mark.proof
def test_disk_with_the_report_is_full(crate: Crate, small_disk: Path, book: Book) -> None:
    """A recording that does not fit is left out as a whole, so that the report has room; its volume goes."""
    writes = 'open("/dodo/report/test.rec", "wb").write(bytes(200_000))\n'
    job = crate.job("full", judge=DRIVES, environment=writes + READY + WAIT, report=small_disk)
    run = crate.start(job)
    out, _ = run.communicate(timeout=600)
    assert run.returncode == 0, out
    (reason,) = re.findall(r"^PASSED +\S+  .* s  (.*)$", out, re.MULTILINE)
    (note,) = re.findall(r"^ +note: (the report misses files of camera: .*)$", out, re.MULTILINE)
    assert {p.name for p in job.report.iterdir()} == {"logs"}
    book.record("The disk with the report is full", "docker", "passed", f"{reason}; {note}")


def test_runners_without_engine_killed_and_unharmed(crate: Crate, book: Book) -> None:
    """Three at once: what the first two cannot take down any more, the next run does, and nothing of a stranger's."""
    if (engine := engine_socket()) is None:
        pytest.skip("the engine is not reached by a socket of this machine")
    with EngineProxy(engine, crate.bench.folder / "engine.sock") as proxy:
        cut, killed = crate.start(crate.job("cut"), **proxy.variables), crate.start(crate.job("killed"))
        beside = crate.start(crate.job("beside", judge=READY + BEGUN + "time.sleep(3)\n" + PASS))
        for run in (cut, killed, beside):
            wait_for(run, "running")
        killed.kill()
        killed.communicate()
        proxy.cut()
        reason = told(cut, "ERROR")
    assert cut.returncode == 3
    book.record("The engine goes away in the middle of a test", "docker", "error", reason)
    book.record("Two runners at once", "docker", "passed", told(beside, "PASSED"))
    words = ["docker", "run", "-d", "--rm", "--label", "com.docker.compose.project=stranger", IMAGE, "sleep", "600"]
    stranger = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    left = crate.left()
    assert all(any(f"-{slug}-" in name for name in left) for slug in ("cut", "killed"))
    assert not any("-beside-" in name for name in left)
    again = crate.start(crate.job("again", judge=DRIVES))
    notes = [wait_for(again, "removed what a killed run left: ").splitlines()[-1] for _ in range(2)]
    assert told(again, "PASSED") == "it drove"
    assert {f"{crate.mark}-{slug}: 7 containers, networks and volumes" for slug in ("cut", "killed")} == {
        note.removeprefix("removed what a killed run left: ") for note in notes
    }
    note = notes[0].replace(f"{crate.mark}-cut", "test")
    running = subprocess.run(["docker", "ps", "-q", "--no-trunc"], capture_output=True, text=True, check=True).stdout
    subprocess.run(["docker", "rm", "-f", stranger], capture_output=True, check=True)
    assert stranger in running.split()
    book.record("The runner is killed, and run again", "docker", "passed", note)


def test_interrupts(crate: Crate) -> None:
    """One does not wait for a pull, and one takes down what has been started."""
    with socket.create_server(("127.0.0.1", 0)) as mute:
        pulls = crate.start(crate.job("pulls", image=f"127.0.0.1:{mute.getsockname()[1]}/mute:1"), "-v")
        starts = crate.start(crate.job("starts", environment=WAIT), "-v")
        wait_for(pulls, "pulling ")
        pulls.send_signal(signal.SIGINT)
        assert told(pulls, "ERROR") == "the run was interrupted"
    wait_for(starts, "waiting for environment")
    starts.send_signal(signal.SIGINT)
    assert told(starts, "ERROR") == "the run was interrupted"
    assert (pulls.returncode, starts.returncode) == (130, 130)


def test_kept_project_stays_until_it_is_taken_down(crate: Crate) -> None:
    run = crate.start(crate.job("kept", judge=DRIVES), "--keep")
    out, _ = run.communicate(timeout=600)
    assert run.returncode == 0, out
    (line,) = [text for text in out.splitlines() if text.startswith("take it down: ")]
    assert len([name for name in crate.left() if crate.mark in name]) == 8
    subprocess.run(line.removeprefix("take it down: ").split(), capture_output=True, check=True)
    assert not any(crate.mark in name for name in crate.left())
    work_folder.reap_folders()  # with the record of the run
    capabilities.clean()
