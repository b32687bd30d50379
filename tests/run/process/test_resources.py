"""What the application uses, with real processes: one that leaks, one that is busy, one that forks, and a quiet one."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.spec.model import ResourceLimits
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.run.helpers import AFTER_START, PASS, READY, STARTED, WAIT, Bench

pytestmark = pytest.mark.slow

JUDGE = READY + AFTER_START + "time.sleep(2)\n" + PASS
LEAKS = """
kept = []
while True:
    kept.append(bytearray(os.urandom(1000)) * 1000)
    time.sleep(0.05)
"""
BURNS = "time.sleep(0.7)\nend = time.process_time() + 0.5\nwhile time.process_time() < end: pass\n"
FORKS = f"""
kept = bytearray(os.urandom(1 << 20)) * 50
if os.fork() == 0:
    {BURNS.replace(chr(10), chr(10) + "    ")}
    os._exit(0)
os.wait()
for _ in range(3):
    os.fork() or time.sleep(600)
"""
LIMITS = ResourceLimits(max_memory_mb=30.0, max_processor_time_s=0.3)


def limited(plan: Plan, megabytes: int = 2000, limits: ResourceLimits | None = None) -> Plan:
    application = replace(plan.application, limits=SandboxLimits(memory=megabytes * 10**6))
    return replace(plan, application=application, resources=limits)


def judged(outcome: Outcome) -> tuple[str, str]:
    """What became of a test and why, or what was found where the machine was too busy to judge it."""
    if outcome.reason.startswith("the machine was too busy to judge: "):
        return "failed", outcome.reason.partition("; it found: ")[2].rpartition("; run it ")[0]
    return outcome.outcome, outcome.reason


@pytest.mark.parametrize("isolation", ["network", pytest.param("host", marks=pytest.mark.proof)])
def test_each_manner_has_its_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, isolation: str) -> None:
    """Bounds are wide, as the machine may be busy: what is measured is compared exactly in tests of each part."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    bench = Bench(tmp_path, isolation)
    applications = {"leaks": STARTED + LEAKS, "busy": BURNS + STARTED, "forks": FORKS + STARTED, "quiet": STARTED}
    plans = {n: bench.plan(JUDGE, text + WAIT, slug=n, timeout_s=60) for n, text in applications.items()}
    plans["leaks"] = limited(plans["leaks"], 300)
    plans["busy"] = limited(plans["busy"], limits=LIMITS)
    plans["forks"] = limited(plans["forks"], limits=LIMITS)
    plans["quiet"] = limited(plans["quiet"], limits=replace(LIMITS, max_memory_growth=1.0))
    outcomes = {outcome.slug: outcome for outcome in bench.run(*plans.values())}
    use = {name: outcome.resources[0] for name, outcome in outcomes.items()}
    results, reasons = ({name: judged(outcome)[part] for name, outcome in outcomes.items()} for part in (0, 1))
    assert results == {"leaks": "passed", "busy": "failed", "forks": "failed", "quiet": "passed"}
    (note,) = outcomes["leaks"].notes
    assert note.startswith("the memory of application service 'app' grows by ")
    assert "it would reach its limit of 300 MB in " in note
    assert (use["leaks"].memory_growth_bytes_per_s or 0) > 2e6
    assert use["busy"].processor_s > 0.4
    assert reasons["busy"].endswith(" s of processor time, at most 0.3 s")
    assert use["forks"].processor_s > 0.4, "of a child that was waited for"
    assert 50e6 < use["forks"].peak_memory_bytes < 100e6, "what four processes share counts once"
    assert reasons["forks"].startswith("application service 'app' used ")
    assert (use["quiet"].memory_growth_bytes_per_s, outcomes["quiet"].notes) == (0.0, ())
    assert use["quiet"].processor_s < 0.4 and use["quiet"].peak_memory_bytes < 30e6
    assert len(outcomes["quiet"].checks) == 3
