"""What counts the processes of an application: an own user id, and control groups where there are some."""

import os
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run.process import process_group
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.run.desk import ROOT
from tests.run.helpers import PASS, READY, WAIT, Bench

as_root = pytest.mark.skipif(os.getuid() != 0, reason="who is no root has one user id")
THREADS = """
import threading
for _ in range(20):
    threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes", [0, 10])
def test_the_tests_own_limit_holds(tmp_path: Path, processes: int) -> None:
    """What was never begun is no failure of the application; what began and asks for more has failed."""
    bench = Bench(tmp_path)
    plan = bench.plan(judge=READY + WAIT, application=THREADS)
    plan = replace(plan, application=replace(plan.application, limits=SandboxLimits(processes=processes)))
    (outcome,) = bench.run(plan)
    if processes:
        assert outcome.outcome == "failed", outcome
        assert any("can't start new thread" in line for line in outcome.last_lines)
    else:
        assert outcome.outcome == "error", outcome
        assert outcome.reason.startswith("service 'app' could not be started: its sandbox cannot be set up: bwrap: ")


@as_root
@pytest.mark.proof
def test_the_limit_holds_without_control_groups() -> None:
    """The kernel then counts by user."""
    hidden = ["bwrap", "--dev-bind", "/", "/", "--tmpfs", "/sys/fs/cgroup", "--cap-add", "ALL"]
    test = [sys.executable, "-m", "pytest", "-q", f"{__file__}::test_the_tests_own_limit_holds"]
    done = subprocess.run([*hidden, *test], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drive", "", "gone"])
def test_a_program_that_cannot_be_executed_is_an_error(tmp_path: Path, name: str) -> None:
    bench = Bench(tmp_path)
    program = tmp_path / "drive"
    program.write_text("#!/nowhere/python\n")
    program.chmod(0o755)
    plan = bench.plan(judge=READY + WAIT)
    (app,) = plan.application.services
    started = str(tmp_path / name) if name else "no-such-program"
    apps = (replace(app, process=(started,)),)
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=apps)))
    reason = f"service 'app' could not be started: {started}: No such file or directory"
    assert (outcome.outcome, outcome.reason.partition(";")[0]) == ("error", reason)


def is_empty(group: Path) -> bool:
    with suppress(OSError):
        return not (group / "cgroup.procs").read_text()
    return False


@as_root
@pytest.mark.slow
def test_no_group_is_left_behind(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    before = {folder for parent in process_group.parents() for folder in parent.glob("dodo-*")}
    bench.run(bench.plan(judge=READY + PASS))
    left = {folder for parent in process_group.parents() for folder in parent.glob("dodo-*")}
    until = time.monotonic() + 10
    while (empty := {folder for folder in left - before if is_empty(folder)}) and time.monotonic() < until:
        time.sleep(0.1)  # another test's is not filled or removed yet
    assert not empty
