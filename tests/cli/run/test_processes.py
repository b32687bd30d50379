"""``dodo run`` as users meet it: a real command on compiled tests of small scripts."""

import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.run.desk import Desk, gone, marks, processes_with, wait_for
from tests.run.helpers import PASS, READY, WAIT, reserved_cids

pytestmark = pytest.mark.slow
HOST = ("--isolation", "host")
"""Where a sandbox takes least time to start."""


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with reserved_cids(2) as cids:
        yield Desk(tmp_path, cids)


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
