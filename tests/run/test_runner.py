"""One job's fault is that job's outcome, and the others go on."""

import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Job, Processes
from dodo_dsl.run.protocol import Backend
from dodo_dsl.run.runner import Policy
from tests.run.helpers import READY, Bench

BROKEN = READY + "import sys; sys.exit(3)\n"


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def with_env_file(plan: Plan, path: str) -> Plan:
    services = tuple(replace(s, env_files=(path,)) for s in plan.application.services)
    return replace(plan, application=replace(plan.application, services=services))


def test_a_fault_of_dodo_is_the_outcome_of_its_test_alone(bench: Bench) -> None:
    """Nobody's home: Python raises what is neither BackendError nor OSError."""
    broken = with_env_file(bench.plan(slug="broken"), "~no-such-user-at-all/own.env")
    outcomes = bench.run(broken, bench.plan(slug="beside"))
    assert [o.outcome for o in outcomes] == ["error", "passed"]
    assert outcomes[0].reason.startswith("a fault of DoDo itself: RuntimeError: ")
    assert outcomes[0].reason.endswith(" (logs/runner.log has more)")
    log = (bench.folder / "report" / "broken" / "logs" / "runner.log").read_text()
    assert log.startswith("Traceback (most recent call last):\n")


def test_a_report_that_cannot_be_set_aside_ends_the_tries_of_its_test_alone(bench: Bench) -> None:
    (bench.folder / "report" / "broken" / "attempts").mkdir(parents=True)
    (bench.folder / "report" / "broken" / "attempts" / "1").write_text("in the way")
    plans = [bench.plan(slug="broken", judge=BROKEN), bench.plan(slug="beside")]
    broken, beside = bench.run(*plans, policy=Policy(retries=3))
    assert (broken.outcome, beside.outcome) == ("error", "passed")
    assert len(broken.notes) == 2
    assert broken.notes[0].startswith("attempt 1 ended in error: ")
    assert broken.notes[1].startswith("not tried again, as its report cannot be set aside: ")


class Leaky(Processes):
    """Backends whose teardown ends in an error of a kind."""

    def __init__(self, error: Exception) -> None:
        super().__init__(range(200, 230), None, ())
        self.error = error

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Callable[[str], None], keep: bool) -> AsyncIterator[Backend]:
        async with super().open(job, say, keep) as backend:
            yield backend
        raise self.error


class Stuck(Leaky):
    """Backends that cannot be closed for a reason, though they are."""

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Callable[[str], None], keep: bool) -> AsyncIterator[Backend]:
        async with Processes.open(self, job, say, keep) as backend:
            close = backend.close

            async def breaks(keep: bool) -> list[str]:
                await close(keep)
                raise self.error

            backend.close = breaks  # type: ignore[method-assign]
            yield backend


@pytest.mark.parametrize(
    ("error", "note"),
    [
        (OSError(28, "No space left on device"), "not all of the test was taken down: No space left on device"),
        (ValueError("odd"), "not all of the test was taken down: a fault of DoDo itself: ValueError: odd"),
    ],
    ids=["system", "own"],
)
def test_a_verdict_outlives_what_breaks_after_it(bench: Bench, error: Exception, note: str) -> None:
    (outcome,) = bench.run(bench.plan(), backends=Leaky(error))
    assert (outcome.outcome, outcome.reason) == ("passed", "it drove")
    assert [text[: len(note)] for text in outcome.notes] == [note]


def test_a_verdict_outlives_a_backend_that_cannot_be_closed(bench: Bench) -> None:
    (outcome,) = bench.run(bench.plan(), backends=Stuck(ValueError("odd")))
    assert (outcome.outcome, outcome.reason) == ("passed", "it drove")
    assert outcome.notes == ("not all of the test was taken down: ValueError: odd",)
