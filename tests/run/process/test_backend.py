"""Tests with real processes in a real sandbox: what starts them, watches them, keeps them apart and ends them.

What becomes of a test whatever its processes do is tested without them, in ``tests/run/test_engine.py``.
"""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from tests.run.desk import processes_with
from tests.run.helpers import AFTER_START, BEGUN, PASS, READY, STARTED, WAIT, Bench

pytestmark = pytest.mark.slow


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """Tests on the host, where a sandbox takes least time to start."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return Bench(tmp_path, "host")


@pytest.fixture(params=["network", "host"])
def bench(request: pytest.FixtureRequest, host: Bench) -> Bench:
    host.isolation = request.param
    return host


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="this kernel counts no waits")
def test_what_application_and_services_used_is_measured(bench: Bench) -> None:
    """The application's part is that of a process which it has started, and which has ended before the test does."""
    work = "import time\nwhile time.process_time() < 1.2: pass"
    application = f"import subprocess\nsubprocess.run([sys.executable, '-c', {work!r}])\n" + STARTED + WAIT
    works = "end = time.process_time() + 0.05\nwhile time.process_time() < end: pass\ntime.sleep(0.5)\n"
    (outcome,) = bench.run(bench.plan(application=application, judge=READY + AFTER_START + works + PASS))
    load = outcome.machine
    assert load is not None and load.application is not None and load.services is not None
    assert (outcome.outcome, load.cores) == ("passed", len(os.sched_getaffinity(0)))
    assert (load.application.longest, load.services.longest in ("camera", "judge")) == ("app", True)
    assert load.application.ran_s > 0.2 > load.services.ran_s > 0.0


JOINS = """
time.sleep(0.5)
from dodo_dsl.opendlv.session import Session
session = Session(int(sys.argv[1].removeprefix("--cid=")))
"""


def test_it_begins_when_the_application_has_joined_the_bus(bench: Bench) -> None:
    plan = bench.plan(application=JOINS + STARTED + WAIT, judge=READY + BEGUN + PASS)
    (app,) = plan.application.services
    consuming = replace(app, inputs=("opendlv.sim.Frame",))
    (outcome,) = bench.run(replace(plan, application=replace(plan.application, services=(consuming,))))
    assert (outcome.outcome, outcome.notes) == ("passed", ()), outcome.reason
    assert outcome.setup_s is not None and outcome.setup_s > 0.5


STUBBORN = """
import signal, subprocess
signal.signal(signal.SIGTERM, signal.SIG_IGN)
subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)", "{mark}"], start_new_session=True)
print(sys.argv[1:], flush=True)
"""


def test_tests_at_once_are_apart_and_leave_nothing(bench: Bench) -> None:
    """Services that ignore SIGTERM, and daemons that left their session, end with the test.

    Each application sees its own flags; on the host these differ from test to test.
    """
    mark = f"dodo-mark-{os.getpid()}-{bench.isolation}"
    application = STUBBORN.format(mark=mark) + STARTED + WAIT
    judge = READY + AFTER_START + PASS
    plans = [bench.plan(judge=judge, application=application, slug=f"test-{n}") for n in range(3)]
    outcomes = bench.run(*plans, parallel=3)
    assert [o.outcome for o in outcomes] == ["passed"] * 3
    assert processes_with(mark) == []
    assert _fork_servers() == []
    assert list((bench.folder / "leases").glob("*.lease")) == []
    shown = [bench.log(p, "application.app") for p in plans]
    if bench.isolation == "host":
        assert len({o.cid for o in outcomes}) == 3
        assert len(set(shown)) == 3
        assert all("--name=dodo-" in t for t in shown)
    else:
        assert all("'--name=video0.argb'" in t for t in shown)
    assert all(f"--cid={o.cid}" in t for o, t in zip(outcomes, shown, strict=True))


def _fork_servers() -> list[str]:
    """Those that this process has started."""
    children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    return [pid for pid in processes_with("dodo_dsl.run.process.fork_server") if pid in children]


def test_application_without_flags_runs_alone_on_the_host(host: Bench) -> None:
    span = "import time, pathlib\nt = time.monotonic()\n" + READY + "time.sleep(0.4)\n"
    span += "open(sys.argv[0] + '.span', 'w').write(f'{t} {time.monotonic()}')\n" + PASS
    outcomes = host.run(*(host.plan(judge=span, slug=f"alone-{n}", command=()) for n in range(2)), parallel=2)
    assert [o.outcome for o in outcomes] == ["passed"] * 2
    spans = sorted(tuple(map(float, p.read_text().split())) for p in host.folder.glob("*.span"))
    assert len(spans) == 2
    assert spans[0][1] <= spans[1][0]


IS_THERE = """
def is_there(name):
    try:
        return open(name).read() == "there"
    except OSError:
        return False
"""


def test_what_is_hidden_in_the_applications_folder_is_absent(tmp_path: Path) -> None:
    """But what dodo.yml names."""
    bench = Bench(tmp_path, "network")
    names = ("truths/a.csv", "truths/own.txt", "data/own.rec", "kept/a.rec")
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("there")
    look = f"{IS_THERE}os.chdir({str(tmp_path)!r})\nprint([n for n in {names} if is_there(n)])"
    plan = bench.plan(application=look + "\nsys.exit(7)", judge=READY + WAIT)
    limits = replace(plan.application.limits, reads=("data/own.rec",))
    application = replace(plan.application, hidden=("truths/a.csv", "data", "kept"), limits=limits)
    bench.run(plan := replace(plan, application=application))
    assert bench.log(plan, "application.app") == "['truths/own.txt', 'data/own.rec']\n"
