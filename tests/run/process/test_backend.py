"""What happens in a test and what becomes of it, each with real processes, in namespaces and on the host."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.plan.model import Application, ApplicationService
from dodo_dsl.run import engine
from dodo_dsl.run.process.host_isolation import namespaces_refusal
from tests.run.helpers import FAIL, PASS, READY, WAIT, Bench


@pytest.fixture(params=["network", "host"])
def bench(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    if request.param == "network" and (why := namespaces_refusal()):
        pytest.skip(f"no namespaces here: {why}")
    return Bench(tmp_path, request.param)


CASES = {
    "passes": ({}, "passed", "it drove"),
    "fails": ({"judge": READY + FAIL}, "failed", "hit wall left"),
    "application-exits-0": (
        {"application": "", "judge": READY + WAIT},
        "failed",
        "application service 'app' ended with exit code 0 after",
    ),
    "application-crashes": (
        {"application": "raise SystemExit(3)", "judge": READY + WAIT},
        "failed",
        "application service 'app' ended with exit code 3 after",
    ),
    "judge-crashes-after-its-verdict": (
        {"judge": READY + PASS + "raise SystemExit(2)"},
        "error",
        "service 'judge' of layer evaluation ended with exit code 2",
    ),
    "verdict-before-the-begin": (
        {"judge": PASS + READY + WAIT},
        "error",
        "evaluator 'judge' gave a verdict before the test began",
    ),
    "timeout": (
        {"judge": READY + WAIT, "timeout_s": 0.5},
        "error",
        "evaluator 'judge' gave no verdict within the timeout of 0.5 s",
    ),
    "camera-crashes": (
        {"environment": READY + "time.sleep(0.2); raise SystemExit(1)", "judge": READY + WAIT},
        "error",
        "service 'camera' of layer environment ended with exit code 1",
    ),
    "camera-never-ready": (
        {"environment": "raise SystemExit(0)"},
        "error",
        "service 'camera' of layer environment ended with exit code 0 during set-up, before it was ready",
    ),
    "source-runs-out": ({"environment": READY + "time.sleep(0.1)"}, "passed", "it drove"),
    "application-says-it-passed": (
        {"application": PASS + WAIT, "judge": READY + WAIT, "timeout_s": 0.5},
        "error",
        "evaluator 'judge' gave no verdict",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_outcome(bench: Bench, case: str) -> None:
    parts, expected, reason = CASES[case]
    (outcome,) = bench.run(bench.plan(**parts))
    assert (outcome.outcome, outcome.reason[: len(reason)]) == (expected, reason)


def test_missing_program_is_an_error(bench: Bench) -> None:
    broken = Application(".", (ApplicationService("app", ("no-such-program-of-dodo",)),))
    (outcome,) = bench.run(replace(bench.plan(), application=broken))
    assert outcome.outcome == "error"
    assert outcome.reason == "service 'app' could not be started: no-such-program-of-dodo: No such file or directory"


def test_last_lines_and_logs_of_the_service_that_decided(bench: Bench) -> None:
    plan = bench.plan(judge=READY + WAIT, application="print('cone lost'); raise SystemExit(7)")
    (outcome,) = bench.run(plan)
    assert outcome.last_lines == ("cone lost",)
    assert bench.log(plan, "application.app") == "cone lost\n"


def test_everything_is_gone_afterwards(bench: Bench) -> None:
    """Services that ignore SIGTERM, and daemons that left their session, end with the test."""
    mark = f"dodo-mark-{os.getpid()}-{bench.isolation}"
    daemon = f'[sys.executable, "-c", "import time; time.sleep(600)", "{mark}"]'
    stubborn = "import signal, subprocess\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    stubborn += f"subprocess.Popen({daemon}, start_new_session=True)\n" + WAIT
    (outcome,) = bench.run(bench.plan(application=stubborn))
    assert outcome.outcome == "passed"
    left = [p for p in Path("/proc").glob("[0-9]*/cmdline") if mark.encode() in _read(p)]
    assert left == []


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


def test_tests_at_once_do_not_share_cid_or_memory(bench: Bench) -> None:
    """Each application sees its own flags; on the host these differ from test to test."""
    show = "print(sys.argv[1:], flush=True)\n" + WAIT
    plans = [bench.plan(application=show, slug=f"test-{n}") for n in range(3)]
    outcomes = bench.run(*plans, parallel=3)
    assert [o.outcome for o in outcomes] == ["passed"] * 3
    told = [bench.log(p, "application.app") for p in plans]
    if bench.isolation == "host":
        assert len({o.cid for o in outcomes}) == 3
        assert len(set(told)) == 3
        assert all("--name=dodo-" in t for t in told)
    else:
        assert all("'--name=video0.argb'" in t for t in told)
    assert all(f"--cid={o.cid}" in t for o, t in zip(outcomes, told, strict=True))


def test_application_without_flags_runs_alone_on_the_host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    bench = Bench(tmp_path, "host")
    span = "import time, pathlib\nt = time.monotonic()\n" + READY + "time.sleep(0.4)\n"
    span += "open(sys.argv[0] + '.span', 'w').write(f'{t} {time.monotonic()}')\n" + PASS
    outcomes = bench.run(*(bench.plan(judge=span, slug=f"alone-{n}", command=()) for n in range(2)), parallel=2)
    assert [o.outcome for o in outcomes] == ["passed"] * 2
    spans = sorted(tuple(map(float, p.read_text().split())) for p in tmp_path.glob("*.span"))
    assert len(spans) == 2
    assert spans[0][1] <= spans[1][0]


def test_set_up_and_execution_are_measured_apart(bench: Bench) -> None:
    judge = READY + "time.sleep(2.0)\n" + PASS
    (outcome,) = bench.run(bench.plan(environment="time.sleep(0.5)\n" + READY + WAIT, judge=judge))
    assert outcome.setup_s is not None
    assert outcome.execution_s is not None
    assert outcome.setup_s >= 0.5
    assert outcome.execution_s > 0.3


def test_a_service_that_may_take_longer_to_get_ready_is_waited_for(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two that need two seconds, with one for all services: one of them has more by its manifest."""
    monkeypatch.setattr(engine, "READY_PATIENCE_S", 1.0)
    slow = bench.plan(environment="time.sleep(2)\n" + READY + WAIT, slug="slow")
    camera, judge = slow.services
    patient = replace(slow, name="patient", slug="patient", services=(replace(camera, setup_s=30.0), judge))
    outcomes = bench.run(slow, patient)
    assert [o.outcome for o in outcomes] == ["error", "passed"]
    assert outcomes[0].reason == "service 'camera' was not ready within 1 s"
