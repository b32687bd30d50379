"""An application's limit of processes, which the kernel counts by its own user id, and programs that never begin."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.run.helpers import READY, WAIT, Bench

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
