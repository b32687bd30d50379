"""An application takes too much, or stays after its test."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.run.process import process_group
from dodo_dsl.run.work_folder import meeting_place
from dodo_dsl.spec.model import ResourceLimits
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.run.desk import gone, processes_with
from tests.run.helpers import AFTER_START, PASS, READY, STARTED, WAIT, Bench

pytestmark = pytest.mark.slow
TAKES = "held = []\nwhile True:\n    held.append(b'x' * 10_000_000)\n    time.sleep(0.02)\n"
CHILD_TAKES = f"if os.fork() == 0:\n    exec({TAKES!r})\nos.wait()\n" + WAIT
STAYS = """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        os.execve(sys.executable, [sys.executable, "-c", "import time; time.sleep(600)", "MARK"], {})
    os._exit(0)
os.wait()
"""


HIDES = """
import os, signal, time
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
for number in range(75):
    if os.fork() == 0:
        while time.process_time() < 0.02: pass
        os._exit(0)
    time.sleep(0.01)
try:
    os.wait()
except ChildProcessError:
    pass
"""
"""1.5 s of processor time in children for which nobody waits, so that it is added to nobody's."""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return Bench(tmp_path, "network")


@pytest.mark.parametrize("application", [TAKES, CHILD_TAKES], ids=["itself", "child"])
def test_memory_without_end(bench: Bench, application: str) -> None:
    """A program that takes memory without end is ended, and its test fails."""
    plan = bench.plan(judge=READY + WAIT, application=application, timeout_s=60)
    limited = replace(plan.application, limits=SandboxLimits(memory=200_000_000))
    (outcome,) = bench.run(replace(plan, application=limited))
    assert outcome.outcome == "failed"
    assert outcome.reason.startswith("application service 'app' ran out of memory")
    (note,) = [note for note in outcome.notes if "MB of memory, at most 200" in note]
    assert note.startswith("application service 'app' used ")


@pytest.mark.parametrize("isolation", ["network", "host"])
def test_a_child_that_hides_does_not_outlive_its_test(bench: Bench, isolation: str) -> None:
    """A child with another session, another parent and no environment does not outlive its test."""
    bench.isolation = isolation
    mark = f"hides-{bench.folder.name}-{isolation}"
    plan = bench.plan(judge=READY + AFTER_START + PASS, application=STAYS.replace("MARK", mark) + STARTED + WAIT)
    (outcome,) = bench.run(plan)
    assert (outcome.outcome, outcome.reason) == ("passed", "it drove")
    assert gone(mark, 5.0), processes_with(mark)


@pytest.mark.parametrize("isolation", ["network", "host"])
def test_where_services_of_another_test_meet_is_not_there(bench: Bench, isolation: str) -> None:
    """An application does not see the channels of other tests, also as root that takes away what hides them."""
    bench.isolation = isolation
    with meeting_place(Path("dodo-run-other"), keep=False) as other:
        sought = Path(other) / "sought"
        sought.touch()
        look = f"import subprocess\nsubprocess.run(['umount', {str(sought.parents[1])!r}], check=False)\n"
        look += f"print('seen' if os.path.exists({str(sought)!r}) else 'hidden', flush=True)\n"
        plan = bench.plan(judge=READY + AFTER_START + PASS, application="import os\n" + look + STARTED + WAIT)
        (outcome,) = bench.run(plan)
    assert outcome.outcome == "passed"
    assert "hidden" in bench.log(plan, "application.app").splitlines()


def test_what_it_writes_goes_with_the_test(bench: Bench) -> None:
    own = bench.folder / "data.txt"
    own.write_text("as it was")
    write = f"open({str(own)!r}, 'a').write('!')\nopen({str(own)!r} + '.new', 'w').close()\n"
    application = write + f"assert open({str(own)!r}).read() == 'as it was!'\n" + STARTED + WAIT
    (outcome,) = bench.run(bench.plan(judge=READY + AFTER_START + PASS, application=application))
    assert outcome.outcome == "passed"
    assert own.read_text() == "as it was"
    assert not Path(f"{own}.new").exists()


def test_children_for_which_nobody_waits_are_in_the_account(bench: Bench) -> None:
    """The bound is wide: what was used before the test began does not count."""
    if (group := process_group.make(200)) is None:
        pytest.skip("this user may make no control group")
    group.remove()
    plan = bench.plan(judge=READY + AFTER_START + PASS, application=f"time.sleep(0.7)\n{HIDES}{STARTED}{WAIT}")
    (outcome,) = bench.run(replace(plan, resources=ResourceLimits(max_processor_time_s=0.6)))
    (use,) = outcome.resources
    assert use.processor_s > 0.6
    assert outcome.outcome == "failed" and outcome.reason.endswith(" s of processor time, at most 0.6 s")
