"""``dodo run`` as users meet it, a real command on tests of small scripts, and faults of the runner and its disk."""

import os
import re
import signal
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.plan.model import Flag, Plan, PlannedService
from tests.faults import Book
from tests.run.desk import Desk, gone, marks, processes_with, wait_for
from tests.run.helpers import PASS, READY, WAIT, reserved_cids

pytestmark = pytest.mark.slow
FLOODS = "while True: print('x' * 1000, flush=True)\n"
HOST = ("--isolation", "host")
STUBBORN = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
TALKS = """
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.session import Session
with Session(int(sys.argv[1].partition("=")[2])) as bus:
    while True:
        bus.send_envelope(Envelope(1086, b"", 1, 1, 1, 0))
        time.sleep(0.05)
"""


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with reserved_cids(2) as cids:
        yield Desk(tmp_path, cids)


def recorded(plan: Plan) -> Plan:
    """The same test, with the recorder that every compiled test has."""
    flags = (Flag("rec", "test.rec", "report"), Flag("cid", str(plan.cid)))
    process = ("python", "-m", "services.rec_recorder")
    recorder = PlannedService("environment", "dodo-recorder", "rec-recorder", "x", process, flags)
    return replace(plan, services=(recorder, *plan.services))


def test_disk_with_the_report_is_full(desk: Desk, small_disk: Path, book: Book) -> None:
    """Logs fill the disk, then the recorder cannot go on; the run says so without a report."""
    plan = desk.bench.plan(READY + WAIT, FLOODS, slug="test-full", timeout_s=30.0)
    script = desk.bench.script("test-talker", "import sys, time\n" + READY + TALKS)
    talker = PlannedService("environment", "talker", "x", "x", script, (Flag("cid", str(plan.cid)),))
    plan = replace(plan, services=(*recorded(plan).services, talker))
    full = desk.start(plan, *HOST, report=small_disk.name)
    neighbour = desk.start(
        desk.bench.plan(READY + "time.sleep(2)\n" + PASS, slug="test-beside"), *HOST, report="beside"
    )
    out, beside = full.communicate(timeout=200)[0], neighbour.communicate(timeout=200)[0]
    assert neighbour.returncode == 0, beside
    (reason,) = re.findall(r"^ERROR   test-full  (.*) \(set-up", out, re.MULTILINE)
    assert reason.startswith("service 'dodo-recorder' of layer environment ended with exit code 1 after ")
    assert re.search(r"test.rec ends after \d+ messages: No space left on device\n", out)
    unwritten = "cannot take the whole report: No space left on device"
    assert f"\n'{small_disk}' {unwritten}\n" in out
    assert "Traceback" not in out
    assert gone(marks(desk))
    assert list((desk.folder / "leases").glob("*.lease")) == []
    book.record("The disk with the report is full", "process", "error", f"{reason}; 'dodo-report' {unwritten}")


@pytest.mark.parametrize("isolation", ["network", "host"])
def test_killed_runner_leaves_nothing(desk: Desk, isolation: str) -> None:
    process = desk.start(desk.bench.plan(judge=READY + WAIT), "--isolation", isolation)
    wait_for(process, "running")
    process.kill()
    process.communicate(timeout=200)
    assert gone(marks(desk))


def test_next_run_removes_what_a_killed_sandbox_left_on_the_host(desk: Desk, book: Book) -> None:
    """Runner and sandbox both killed: of what does not end when its parent dies, only the lease's record says it."""
    process = desk.start(desk.bench.plan(judge=STUBBORN + READY + WAIT), "--isolation", "host")
    wait_for(process, "running")
    while len(processes_with(f"{desk.folder}/test-app")) < 2:  # bubblewrap has started it, and ends with its parent
        time.sleep(0.02)
    sandboxes = [pid for pid in processes_with("dodo_dsl.run.process.sandbox") if parent(pid) == process.pid]
    assert len(sandboxes) == 1
    os.kill(int(sandboxes[0]), signal.SIGSTOP)
    process.kill()
    os.kill(int(sandboxes[0]), signal.SIGKILL)
    process.communicate(timeout=200)
    while len(processes_with(marks(desk))) > 1:
        time.sleep(0.02)
    assert processes_with(marks(desk))
    second = desk.start(desk.bench.plan(slug="second"), *HOST, report="second")
    out, _ = second.communicate(timeout=200)
    assert second.returncode == 0, out
    (note,) = [line for line in out.splitlines() if line.startswith("removed what a killed run left: test: 1 proc")]
    assert gone(marks(desk))
    assert list((desk.folder / "leases").glob("*.lease")) == []
    book.record("The runner is killed, and run again", "process", str(desk.results("second")[0]["outcome"]), note)


def parent(pid: str) -> int:
    return int(Path("/proc", pid, "stat").read_text().rpartition(")")[2].split()[1])


def meets(desk: Desk, number: int) -> str:
    """Waits until the judge of the other run, 1 or 0, is there."""
    here, there = (str(desk.bench.folder / f"judge-{n}") for n in (number, 1 - number))
    return f"open({here!r}, 'w').close()\nwhile not os.path.exists({there!r}):\n    time.sleep(0.02)\n"


def test_two_runs_at_once(desk: Desk, book: Book) -> None:
    plans = [desk.bench.plan(slug=f"test-{n}", judge=READY + meets(desk, n) + PASS, timeout_s=60) for n in range(2)]
    processes = [desk.start(p, "--isolation", "host", report=p.slug) for p in plans]
    outs = [p.communicate(timeout=200)[0] for p in processes]
    assert [p.returncode for p in processes] == [0, 0], outs
    results = [desk.results(p.slug)[0] for p in plans]
    assert len({result["cid"] for result in results}) == 2
    for result in results:
        book.record("Two runners at once", "process", str(result["outcome"]), str(result["reason"]))


@pytest.mark.proof
def test_letters_that_the_terminal_lacks_cost_no_verdict(desk: Desk) -> None:
    desk.environment["PYTHONIOENCODING"] = "ascii"
    process = desk.start(desk.bench.plan(judge=READY + PASS.replace("it drove", "it turned 5\\\\u00b0 and")), *HOST)
    out, _ = process.communicate(timeout=200)
    assert process.returncode == 0, out
    assert re.search("^PASSED  test .*  it turned 5[?] and", out, re.MULTILINE)


def test_reader_that_leaves_does_not_end_the_run(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(), *HOST)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(200) == 0
    (test,) = desk.results()
    assert test["outcome"] == "passed"


def test_kept_test_stays_until_it_is_taken_down(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(), "--keep")
    out, _ = process.communicate(timeout=200)
    assert process.returncode == 0, out
    assert processes_with(marks(desk))
    (pid,) = [line.rpartition(" ")[2] for line in out.splitlines() if line.startswith("take it down: kill ")]
    other = desk.start(desk.bench.plan(slug="other"), *HOST, report="other")
    assert other.communicate(timeout=200)[0]
    assert processes_with(marks(desk)), "the next run takes no kept test down"
    os.kill(int(pid), signal.SIGTERM)
    assert gone(marks(desk))


def test_interrupt_takes_everything_down_and_still_reports(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(judge=READY + WAIT))
    wait_for(process, "running")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=200)
    assert process.returncode == 130, out
    assert "Traceback" not in out
    (test,) = desk.results()
    assert (test["outcome"], test["reason"]) == ("error", "the run was interrupted")
    assert gone(marks(desk))
