"""User ids of an application's own: nobody else has them, and they are counted for it alone."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run.process import places, process_group
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.run.desk import ROOT
from tests.run.helpers import AFTER_START, PASS, READY, STARTED, WAIT, Bench

as_root = pytest.mark.skipif(os.getuid() != 0, reason="who is no root has one user id")
LEASES = "import json, sys\nfrom dodo_dsl.run.process import places as users\n"
USER, CID = 64_517, 244
"""No CID leads to this user."""
THREADS = """
import threading
for _ in range(20):
    threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
"""


@contextmanager
def sleeping(user: int, count: int) -> Iterator[None]:
    """Other work of a user on this machine."""
    words = ["setpriv", f"--reuid={user}", "--clear-groups", "sleep", "100"]
    others = [subprocess.Popen(words) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def leased(preferred: Sequence[int]) -> list[int]:
    """The ids that one process leases, which holds them until it ends."""
    program = f"{LEASES}print(json.dumps([users.lease_user(each) for each in {list(preferred)}]))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    return [int(each) for each in json.loads(done.stdout)]


@as_root
def test_each_gets_an_id_of_its_own() -> None:
    first, second = leased((USER, USER))
    assert first == USER
    assert second in range(places.FIRST, places.LAST + 1)
    assert first != second


@as_root
@pytest.mark.thorough
def test_an_id_comes_free_with_its_holder() -> None:
    assert leased((USER + 1,)) == [USER + 1]
    deadline = time.monotonic() + 60
    while leased((USER + 1,)) != [USER + 1]:  # the kernel ends it a little later than its parent
        assert time.monotonic() < deadline


@as_root
def test_an_id_of_other_work_is_left_alone() -> None:
    with sleeping(USER + 2, 1):
        assert leased((USER + 2,)) != [USER + 2]


@as_root
def test_an_id_of_the_machines_own_users_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []
    monkeypatch.setattr(places, "_known_ids", lambda: {USER, places.FIRST})

    def is_held(user: int) -> bool:
        tried.append(user)
        return True

    monkeypatch.setattr(places, "_is_held", is_held)
    assert places.lease_user(USER) == tried[0] == places.FIRST + 1


def test_where_none_is_free_the_reason_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "_is_held", lambda _: False)
    with pytest.raises(OSError, match="no user id from 64000 to 64999 is free: other processes"):
        places.lease_user(USER)


def drive(folder: Path) -> str:
    """The outcome of a test of 40 processes at most, whose application has 20 threads and more."""
    bench = Bench(folder)
    plan = bench.plan(judge=READY + AFTER_START + PASS, application=THREADS + STARTED + WAIT)
    plan = replace(plan, cid=CID, application=replace(plan.application, limits=SandboxLimits(processes=40)))
    return " ".join(f"{outcome.outcome}: {outcome.reason}" for outcome in bench.run(plan))


@as_root
@pytest.mark.slow
@pytest.mark.parametrize("hides", [pytest.param((), marks=pytest.mark.proof), ("--tmpfs", "/sys/fs/cgroup")])
def test_other_work_of_the_same_id_does_not_count(tmp_path: Path, hides: tuple[str, ...]) -> None:
    """Also where the kernel counts by user, as there are no control groups."""
    program = f"from tests.run.process.confined.test_users import *\nprint(drive(Path({str(tmp_path)!r})))"
    words = ["bwrap", "--dev-bind", "/", "/", *hides, "--cap-add", "ALL", sys.executable, "-c", program]
    with sleeping(places.FIRST + CID, 60):
        done = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "passed: it drove\n"


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


@pytest.mark.slow
def test_a_program_that_cannot_be_executed_is_an_error(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    program = tmp_path / "drive"
    program.write_text("#!/nowhere/python\n")
    program.chmod(0o755)
    plan = bench.plan(judge=READY + WAIT)
    (app,) = plan.application.services
    apps = (replace(app, process=(str(program),)),)
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=apps)))
    reason = f"service 'app' could not be started: {program}: No such file or directory"
    assert (outcome.outcome, outcome.reason) == ("error", reason)


def proc_of(folder: Path, version: int, group: str) -> Path:
    """A ``/proc/self`` that shows a tree of control groups in a folder."""
    options, controllers = ("rw,pids", "pids") if version == 1 else ("rw", "")
    kind = "cgroup" if version == 1 else "cgroup2"
    proc = folder / "proc"
    proc.mkdir()
    (proc / "cgroup").write_text(f"7:memory:/elsewhere\n{0 if version == 2 else 8}:{controllers}:{group}\n")
    (proc / "mountinfo").write_text(
        f"30 25 0:26 / /sys rw - sysfs sysfs rw\n31 30 0:27 /docker {folder}/tree rw - {kind} none {options}\n"
    )
    (folder / "tree" / "own").mkdir(parents=True)
    return proc


@pytest.mark.parametrize(
    ("version", "handing", "parent"),
    [(1, "", "tree/own"), (2, "tree/own", "tree/own"), (2, "tree", "tree"), (2, "", None)],
)
def test_where_a_group_is_made(tmp_path: Path, version: int, handing: str, parent: str | None) -> None:
    proc = proc_of(tmp_path, version, "/docker/own")
    if handing:
        (tmp_path / handing / "cgroup.subtree_control").write_text("memory pids\n")
    found = list(process_group._parents(proc))
    assert found == ([tmp_path / parent] if parent else [])


def test_a_group_that_is_not_seen_holds_nothing(tmp_path: Path) -> None:
    assert list(process_group.holding(proc_of(tmp_path, 1, "/elsewhere"))) == []


def test_groups_of_killed_runs_are_removed_and_new_ones_are_not(tmp_path: Path) -> None:
    proc = proc_of(tmp_path, 1, "/docker/own")
    old, new = (tmp_path / "tree/own" / f"dodo-{name}" for name in ("old", "new"))
    for folder in (old, new):
        folder.mkdir()
    os.utime(old, (0, 0))
    process_group.remove_unused(proc)
    assert (old.exists(), new.exists()) == (False, True)


def is_empty(group: Path) -> bool:
    with suppress(OSError):
        return not (group / "cgroup.procs").read_text()
    return False


@as_root
@pytest.mark.slow
def test_no_group_is_left_behind(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    before = {folder for parent in process_group._parents(Path("/proc/self")) for folder in parent.glob("dodo-*")}
    bench.run(bench.plan(judge=READY + PASS))
    left = {folder for parent in process_group._parents(Path("/proc/self")) for folder in parent.glob("dodo-*")}
    until = time.monotonic() + 10
    while (empty := {folder for folder in left - before if is_empty(folder)}) and time.monotonic() < until:
        time.sleep(0.1)  # another test's is not filled or removed yet
    assert not empty
