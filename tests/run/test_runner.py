"""Several tests at once, on backends that report given events: one job's error is that job's outcome alone."""

import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Application, ApplicationService, Plan
from dodo_dsl.run.backends import Job
from dodo_dsl.run.protocol import BackendError, Exited
from dodo_dsl.run.runner import Policy, Runner, default_backend
from dodo_dsl.run.schedule import Schedule
from tests.run.helpers import Recorded
from tests.run.scripted import (
    FAILED,
    READY,
    ScriptedBackend,
    ScriptedBackends,
    drives,
    jobs,
    plan,
    run,
    send_signal_after,
)

CRASH = {**READY, "begin": [(1.0, Exited("track", 3))]}
CRASHED = "service 'track' of layer evaluation ended with exit code 3 after 1.0 s"


@dataclass
class Scene:
    """Runs tests in a folder; ``lengths`` are the expected seconds of those that take more than 1 s."""

    folder: Path
    backends: ScriptedBackends = field(default_factory=ScriptedBackends)
    policy: Policy = field(default_factory=Policy)
    capacity: float = 4.0
    lengths: dict[str, float] = field(default_factory=dict)
    progress: Recorded = field(default_factory=Recorded)
    signals: tuple[tuple[float, int], ...] = ()

    def run(self, *plans: Plan, keep: bool = False) -> list[Outcome]:
        order = Schedule(self.capacity, lambda job: 1.0, self._expected)
        self.runner = Runner(self.progress, self.backends, order, self.policy, keep)
        return run(self._run(jobs(self.folder, *plans)))

    async def _run(self, given: list[Job]) -> list[Outcome]:
        for seconds, number in self.signals:
            send_signal_after(seconds, number)
        return await self.runner.run(given)

    def _expected(self, job: Job) -> float:
        return self.lengths.get(job.plan.slug, 1.0)


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
    scene.lengths, scene.capacity = {"a": 1.0, "b": 3.0, "c": 2.0}, 1.0
    assert [outcome.slug for outcome in scene.run(*plans("abc"))] == ["a", "b", "c"]
    assert scene.backends.began == ["b", "c", "a"]
    assert scene.progress.notes == ["prepared 3"]
    assert [left for _, left in scene.progress.rests] == [2, 1]
    assert scene.backends.closed == 1


@pytest.mark.parametrize(("capacity", "most"), [(1.0, 1), (2.5, 2), (9.0, 5)])
def test_as_many_run_at_once_as_there_is_room_for(scene: Scene, capacity: float, most: int) -> None:
    scene.capacity = capacity
    assert [outcome.outcome for outcome in scene.run(*plans("abcde"))] == ["passed"] * 5
    assert scene.backends.most == most


def test_a_kept_test_is_explained(scene: Scene) -> None:
    scene.run(plan(), keep=True)
    assert scene.runner.kept == ["look inside"]


@pytest.mark.parametrize(("fail_fast", "began"), [(True, ["a"]), (False, ["a", "b", "c"])])
def test_fail_fast_begins_no_further_test(scene: Scene, fail_fast: bool, began: list[str]) -> None:
    scene.lengths, scene.capacity, scene.policy = {"a": 3.0, "b": 2.0}, 1.0, Policy(fail_fast)
    scene.backends.make = by_slug(a=drives(1.0, FAILED))
    outcomes = scene.run(*plans("abc"))
    assert (scene.backends.began, [outcome.slug for outcome in outcomes]) == (began, began)
    assert outcomes[0].outcome == "failed"
    assert [job.test for job in scene.runner.skipped] == [name for name in "abc" if name not in began]


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


def test_an_error_is_retried_and_both_attempts_are_kept(logged: Scene) -> None:
    logged.policy = Policy(retries=2)
    (outcome,) = logged.run(plan("a"))
    assert (outcome.outcome, outcome.reason) == ("failed", "hit wall left")
    assert outcome.notes == (f"attempt 1 ended in error: {CRASHED}",)
    report = logged.folder / "report" / "a"
    assert (report / "attempts" / "1" / "logs" / "log").read_text() == "attempt 1"
    assert (report / "logs" / "log").read_text() == "attempt 2"
    assert ("a", f"retrying after error: {CRASHED}") in logged.progress.phases


def test_without_retries_an_error_stays(logged: Scene) -> None:
    (outcome,) = logged.run(plan("a"))
    assert endings([outcome]) == [("a", "error", CRASHED)]
    assert (outcome.notes, logged.backends.began) == ((), ["a"])


def test_errors_that_stay_are_errors(scene: Scene) -> None:
    scene.policy, scene.backends.make = Policy(retries=2), by_slug(a=CRASH)
    (outcome,) = scene.run(plan("a"))
    assert (outcome.outcome, len(outcome.notes), scene.backends.began) == ("error", 2, ["a"] * 3)


def test_what_failed_is_not_retried(scene: Scene) -> None:
    scene.policy, scene.backends.make = Policy(retries=2), by_slug(a=drives(1.0, FAILED))
    assert [outcome.outcome for outcome in scene.run(plan("a"))] == ["failed"]
    assert scene.backends.began == ["a"]


def test_a_report_that_cannot_be_moved_ends_the_retries_of_its_test_alone(logged: Scene) -> None:
    (logged.folder / "report" / "a" / "attempts").mkdir(parents=True)
    (logged.folder / "report" / "a" / "attempts" / "1").write_text("in the way")
    logged.policy = Policy(retries=3)
    a, b = logged.run(*plans("ab"))
    assert (a.outcome, b.outcome) == ("error", "failed")
    assert a.notes[0] == f"attempt 1 ended in error: {CRASHED}"
    assert a.notes[1].startswith("not retried, as its report cannot be moved: ")


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (BackendError("no subnet is free"), "no subnet is free"),
        (OSError(24, "Too many open files"), "this machine cannot run the test: Too many open files"),
        (ValueError("odd"), "internal error: ValueError: odd (traceback in logs/runner.log)"),
    ],
    ids=["backend", "system", "internal"],
)
def test_an_error_of_one_job_is_its_outcome_alone(scene: Scene, problem: Exception, reason: str) -> None:
    def make(tested: Plan, _: int) -> ScriptedBackend:
        return ScriptedBackend(tested, drives(), problem=problem if tested.slug == "a" else None)

    scene.backends.make = make
    assert endings(scene.run(*plans("ab"))) == [("a", "error", reason), ("b", "passed", "it drove")]


def test_backends_that_make_none_are_the_error_of_each_test(scene: Scene) -> None:
    scene.backends.open_problem = BackendError("no Docker engine answers")
    assert {(o.outcome, o.reason) for o in scene.run(*plans("ab"))} == {("error", "no Docker engine answers")}
    assert scene.backends.closed == 1


class Fragile(Recorded):
    """A progress that breaks between two attempts of test a."""

    def phase(self, slug: str, text: str) -> None:
        if slug == "a" and text.startswith("retrying"):
            raise ValueError("odd")


def test_an_error_between_two_attempts_is_the_outcome_of_its_test_alone(scene: Scene) -> None:
    scene.progress, scene.policy, scene.backends.make = Fragile(), Policy(retries=1), by_slug(a=CRASH)
    a, b = scene.run(*plans("ab"))
    assert (a.reason, b.outcome) == ("internal error: ValueError: odd (traceback in logs/runner.log)", "passed")


@pytest.mark.parametrize(
    ("problem", "note"),
    [
        (OSError(28, "No space left on device"), "No space left on device"),
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
    scene.capacity, scene.signals, scene.policy = 1.0, ((4.0, number), (4.5, number)), Policy(retries=1)
    before = signal.getsignal(number)
    assert endings(scene.run(*plans("ab"))) == [
        ("a", "error", "the run was interrupted"),
        ("b", "error", "the run was interrupted before this test began"),
    ]
    assert (scene.runner.interrupted, scene.progress.notes[1:]) == (True, ["interrupted: taking down"])
    assert (scene.backends.began, scene.backends.closed) == (["a"], 1)
    assert signal.getsignal(number) == before


def test_a_signal_during_teardown_keeps_the_verdict(scene: Scene) -> None:
    """A test ends at 7 s, and its teardown at 10 s."""
    made: list[ScriptedBackend] = []

    def make(tested: Plan, _: int) -> ScriptedBackend:
        made.append(ScriptedBackend(tested, drives(5.0), {"close": 3.0}))
        return made[-1]

    scene.backends.make, scene.signals = make, ((8.0, signal.SIGINT), (9.0, signal.SIGINT))
    assert endings(scene.run(plan())) == [("test", "passed", "it drove")]
    assert (scene.runner.interrupted, made[0].calls[-1]) == (True, "close")


def test_containers_are_needed_by_what_cannot_be_started() -> None:
    started, image = ApplicationService("a", ("python", "a.py")), ApplicationService("b")
    assert default_backend([plan(application=Application(".", (started,)))]) == "process"
    assert default_backend([plan(application=Application(".", (started, image)))]) == "docker"
