"""Several tests at once, on backends that report given events: one job's error is that job's outcome alone."""

import asyncio
import signal
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.model import Access
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Job
from dodo_dsl.run.protocol import BackendError, Exited, VerdictEvent
from dodo_dsl.run.runner import Runner
from dodo_dsl.run.schedule import Schedule
from tests.run.helpers import Recorded
from tests.run.scripted import (
    BUSY,
    FAILED,
    PASSED,
    READY,
    ScriptedBackend,
    ScriptedBackends,
    drives,
    jobs,
    load,
    plan,
    run,
    send_signal_after,
)

CRASH = {**READY, "begin": [(1.0, Exited("track", 3))]}
CRASHED = "service 'track' of layer evaluation ended with exit code 3 after 1.0 s"


@dataclass
class Scene:
    """Runs tests in a folder."""

    folder: Path
    backends: ScriptedBackends = field(default_factory=ScriptedBackends)
    policy: dict[str, Any] = field(default_factory=dict)
    capacity: int = 4
    progress: Recorded = field(default_factory=Recorded)
    signals: tuple[tuple[float, int], ...] = ()
    begins: list[tuple[float, int]] = field(default_factory=list)
    """When attempts began, and how many tests ran then."""

    def run(self, *plans: Plan, keep: bool = False) -> list[Outcome]:
        order = Schedule(self.capacity)
        self.runner = Runner(self.progress, self.backends, order, keep=keep, **self.policy)
        return run(self._run(jobs(self.folder, *plans)))

    async def _run(self, given: list[Job]) -> list[Outcome]:
        for seconds, number in self.signals:
            send_signal_after(seconds, number)
        return await self.runner.run(given, lambda *_: None)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene(tmp_path)


def plans(names: str) -> list[Plan]:
    return [plan(name) for name in names]


def endings(outcomes: list[Outcome]) -> list[tuple[str, str, str]]:
    return [(outcome.slug, outcome.outcome, outcome.reason) for outcome in outcomes]


def by_slug(**stages: object) -> Callable[[Plan, int], ScriptedBackend]:
    """Makes backends with these stages by slug; others pass."""
    return lambda tested, _: ScriptedBackend(tested, stages.get(tested.slug, drives()))  # type: ignore[arg-type]


def test_the_longest_begins_first_and_outcomes_keep_the_order_of_the_jobs(scene: Scene) -> None:
    scene.capacity = 1
    given = [plan(name, timeout_s=seconds) for name, seconds in (("a", 10.0), ("b", 30.0), ("c", 20.0))]
    assert [outcome.slug for outcome in scene.run(*given)] == ["a", "b", "c"]
    assert scene.backends.began == ["b", "c", "a"]
    assert scene.progress.notes == ["prepared 3"]


@pytest.mark.parametrize(("fail_fast", "began"), [(True, ["a"]), (False, ["a", "b", "c"])])
def test_fail_fast_begins_no_further_test(scene: Scene, fail_fast: bool, began: list[str]) -> None:
    scene.capacity, scene.policy = 1, {"fail_fast": fail_fast}
    scene.backends.make = by_slug(a=drives(1.0, FAILED))
    outcomes = scene.run(*plans("abc"))
    assert (scene.backends.began, [outcome.slug for outcome in outcomes]) == (began, began)
    assert outcomes[0].outcome == "failed"
    left = [(test.slug, test.reason) for test in scene.runner.not_run]
    assert left == [(name, "a test before did not pass") for name in "abc" if name not in began]


@pytest.fixture
def logged(scene: Scene) -> Scene:
    """Evaluators that crash at the first attempt; each attempt leaves a log of its own."""

    def make(tested: Plan, attempt: int) -> ScriptedBackend:
        log = scene.folder / "report" / tested.slug / "logs" / "log"
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text(f"attempt {attempt}")
        return ScriptedBackend(tested, CRASH if attempt == 1 else drives(1.0, FAILED))

    scene.backends.make = make
    return scene


def test_the_report_of_an_error_stays_where_no_turn_to_try_again_comes(logged: Scene) -> None:
    logged.capacity, logged.policy = 1, {"fail_fast": True, "retries": 1}
    make = logged.backends.make
    logged.backends.make = lambda tested, attempt: make(tested, attempt + (tested.slug == "b"))
    outcomes = logged.run(*plans("ab"))
    assert [(outcome.outcome, outcome.notes) for outcome in outcomes] == [("error", ()), ("failed", ())]
    assert (logged.folder / "report" / "a" / "logs" / "log").read_text() == "attempt 1"


def test_an_error_is_retried_and_both_attempts_are_kept(logged: Scene) -> None:
    logged.policy = {"retries": 2}
    (outcome,) = logged.run(plan("a"))
    assert logged.backends.began == ["a", "a"], "a failure is none"
    assert (outcome.outcome, outcome.reason) == ("failed", "hit wall left")
    assert outcome.notes == (f"attempt 1 ended in error: {CRASHED}",)
    report = logged.folder / "report" / "a"
    assert (report / "attempts" / "1" / "logs" / "log").read_text() == "attempt 1"
    assert (report / "logs" / "log").read_text() == "attempt 2"
    assert ("a", f"waiting to be tried again alone, after error: {CRASHED}") in logged.progress.phases


@pytest.mark.parametrize(
    ("verdict", "keep", "left"), [(PASSED, False, False), (PASSED, True, True), (FAILED, False, True)]
)
def test_pictures_stay_unless_the_test_passed(scene: Scene, verdict: VerdictEvent, keep: bool, left: bool) -> None:
    pictures = scene.folder / "report" / "a" / "frames.rec"
    pictures.parent.mkdir(parents=True)
    pictures.write_bytes(b"pictures")
    scene.backends.make = by_slug(a=drives(1.0, verdict))
    scene.run(plan("a"), keep=keep)
    assert pictures.exists() == left


TOO_BUSY = (
    "the machine was too busy to judge: app waited 0.3 s of 1.0 s for a processor, others took 90 % of the processor; "
    "it found: hit wall left; run it with --clock lockstep, or fewer tests at once (-j 1)"
)


@pytest.fixture
def crowded(logged: Scene) -> Scene:
    """Test a fails, at first as the machine is too busy; others pass after 5 s."""

    def make(tested: Plan, attempt: int) -> ScriptedBackend:
        if tested.slug != "a":
            return ScriptedBackend(tested, drives(5.0))
        log = logged.folder / "report" / "a" / "logs" / "log"
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text(f"attempt {attempt}")
        now = asyncio.get_running_loop().time
        begins.append((now(), logged.backends.now))
        return ScriptedBackend(tested, drives(1.0, FAILED), uses=BUSY if attempt == 1 else load(0.0, app=(0.2, 0.0)))

    begins = logged.begins
    logged.backends.make = make
    return logged


def test_what_a_busy_machine_left_undecided_is_tried_again_alone(crowded: Scene) -> None:
    a, b, c = crowded.run(*plans("abc"))
    assert endings([a, b, c]) == [
        ("a", "failed", "hit wall left"),
        ("b", "passed", "it drove"),
        ("c", "passed", "it drove"),
    ]
    assert a.notes == (f"attempt 1 ended in error: {TOO_BUSY}",)
    assert crowded.begins == [(0.0, 1), (7.0, 1)], "when the others have ended"
    assert [slug for slug, text in crowded.progress.phases if text in ("passed", "failed", "error")][-1:] == ["a"]
    report = crowded.folder / "report" / "a"
    assert (report / "attempts" / "1" / "logs" / "log").read_text() == "attempt 1"
    assert (report / "logs" / "log").read_text() == "attempt 2"


def always_too_busy(tested: Plan, _: int) -> ScriptedBackend:
    return ScriptedBackend(tested, drives(1.0, FAILED), uses=BUSY)


@pytest.mark.parametrize("retries", [0, 2])
def test_a_machine_that_stays_too_busy_is_an_error(scene: Scene, retries: int) -> None:
    scene.backends.make, scene.policy, scene.capacity = always_too_busy, {"retries": retries}, 1
    a, b = scene.run(*plans("ab"))
    assert endings([a, b]) == [("a", "error", TOO_BUSY), ("b", "error", TOO_BUSY)]
    assert scene.backends.began == list("ab" * (1 + max(1, retries)))
    assert len(a.notes) == max(1, retries)


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (BackendError("no subnet is free"), "no subnet is free"),
        (OSError(24, "Too many open files"), "this machine says: Too many open files"),
        (ValueError("odd"), "internal error: ValueError: odd (traceback in logs/runner.log)"),
    ],
    ids=["backend", "system", "internal"],
)
def test_an_error_of_one_job_is_its_outcome_alone(scene: Scene, problem: Exception, reason: str) -> None:
    def make(tested: Plan, _: int) -> ScriptedBackend:
        return ScriptedBackend(tested, drives(), problem=problem if tested.slug == "a" else None)

    scene.backends.make = make
    assert endings(scene.run(*plans("ab"))) == [("a", "error", reason), ("b", "passed", "it drove")]


@pytest.mark.parametrize(
    ("problem", "note"),
    [
        (OSError(28, "No space left on device"), "this machine says: No space left on device"),
        (ValueError("odd"), "internal error: ValueError: odd (traceback in logs/runner.log)"),
    ],
    ids=["system", "internal"],
)
def test_a_verdict_outlives_what_breaks_after_it(scene: Scene, problem: Exception, note: str) -> None:
    scene.backends.leave_problem = problem
    (outcome,) = scene.run(plan())
    assert (outcome.outcome, outcome.reason) == ("passed", "it drove")
    assert outcome.notes == (f"not all of the test was taken down: {note}",)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_what_runs_and_what_waits(scene: Scene, number: int) -> None:
    scene.capacity, scene.signals, scene.policy = 1, ((4.0, number), (4.5, number)), {"retries": 1}
    before = signal.signal(number, lambda *_: None)
    mine = signal.getsignal(number)
    try:
        assert endings(scene.run(*plans("ab"))) == [("a", "error", "the run was interrupted")]
        assert signal.getsignal(number) == mine
    finally:
        signal.signal(number, before)
    assert scene.runner.not_run == [NotRun("b", "b", "b/b.dodo.yml", "sil", "the run was interrupted")]
    assert (scene.runner.interrupted, scene.progress.notes[1:]) == (True, ["interrupted: taking down"])
    assert scene.backends.began == ["a"]
    assert ("b", "error") not in scene.progress.phases


def test_a_secret_that_is_passed_is_told(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DATABASE", "x://a:s3cr3t@b")
    application = replace(plan("a").application, access=Access(passed=("DATABASE",)))
    scene.run(replace(plan("a"), application=application), plan("b"))
    (text,) = [note for note in scene.progress.notes if "DATABASE" in note]
    assert "'DATABASE', which looks like an address with a password" in text
    assert "s3cr3t" not in text
