"""Runs several tests at once, each on its own backend, and leaves a clean machine whatever happens."""

import asyncio
import contextlib
import functools
import os
import signal
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol, Self

from dodo_dsl.application import secret_variables
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.plan.added_services import PICTURES_FILE
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import CombinedBackends, Job
from dodo_dsl.run.engine import Engine
from dodo_dsl.run.outcomes import describe, error_outcome
from dodo_dsl.run.rigs.pool import opened
from dodo_dsl.run.schedule import CorePool, Schedule

BackendName = Literal["process", "docker", "mixed"]
Finished = Callable[[Job, Outcome], None]
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Progress(Protocol):
    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def note(self, text: str) -> None: ...

    def phase(self, slug: str, text: str) -> None: ...

    def done(self, outcome: Outcome) -> None: ...


def default_backend(plans: Sequence[Plan]) -> BackendName:
    """Processes when every service of the applications can be started as one, else containers."""
    services = [s for plan in plans for s in plan.application.services]
    return "process" if all(s.process for s in services) else "docker"


@dataclass(frozen=True)
class Policy:
    """What to do when a test does not pass: begin no further ones; run it again when it ended in error."""

    fail_fast: bool = False
    retries: int = 0


class Runner:
    """Runs jobs, as many at once as ``schedule`` allows, in its order. Times are of the event loop's clock, in s.

    Tests for which the machine was too busy run once more behind all that wait, with all cores.
    """

    def __init__(
        self, progress: Progress, backends: CombinedBackends, schedule: Schedule, policy: Policy, keep: bool = False
    ) -> None:
        self.progress = progress
        self.backends = backends
        self.schedule = schedule
        self.policy = policy
        self.keep = keep
        self.interrupted = False
        self.skipped: list[Job] = []
        self._cores = CorePool(schedule.capacity)
        self._waiting: list[Job] = []
        self.kept: list[str] = []
        """Sentences on the tests that were left running."""
        self._made: dict[str, int] = {}
        """How many attempts at each test there were."""
        self._stop = False
        self._finished: Finished | None = None

    def not_run(self) -> list[NotRun]:
        """The tests that never began, in the order in which they would have."""
        reason = "the run was interrupted" if self.interrupted else "a test before did not pass"
        plans = [job.plan for job in self.skipped]
        return [NotRun(plan.name, plan.slug, plan.spec, plan.level, reason) for plan in plans]

    async def run(self, jobs: Sequence[Job], finished: Finished | None = None) -> list[Outcome]:
        """The outcomes in the order of the jobs; SIGINT, SIGTERM and SIGHUP end all tests with their teardown.

        ``finished`` is called for each test as soon as its outcome is final.
        """
        self._finished = finished
        passed = [name for job in jobs for name in job.plan.application.access.passed]
        for text in secret_variables.passed_secrets(os.environ, passed):
            self.progress.note(text)
        await self.backends.prepare([job.plan for job in jobs], self.progress.note)
        self._waiting = self.schedule.ordered(jobs)
        tasks = {job.plan.slug: asyncio.ensure_future(self._one(job)) for job in self._waiting}
        with _signals_call(lambda: self._interrupt(tasks)):
            await asyncio.gather(*tasks.values())
        return [outcome for job in jobs if (outcome := tasks[job.plan.slug].result()) is not None]

    def _interrupt(self, tasks: Mapping[str, "asyncio.Task[Outcome | None]"]) -> None:
        if not self.interrupted:
            self.interrupted = True
            self.progress.note("interrupted: taking down")
            for task in tasks.values():
                task.cancel()

    async def _one(self, job: Job) -> Outcome | None:
        """A test's outcome, or None when no further test was to begin."""

        outcome = await self._turn(job, self.schedule.need(job), functools.partial(self._outcome, job))
        if outcome is None:
            self.skipped.append(job)
            return None
        if is_undecided(outcome) and not self.interrupted and not self.keep:
            self.progress.phase(job.plan.slug, "waiting for another attempt alone, because the machine was too busy")
            self._waiting.append(job)
            again = functools.partial(self._again, job, outcome)
            outcome = await self._turn(job, self.schedule.capacity, again) or outcome
        self._stop |= self.policy.fail_fast and outcome.outcome != "passed"
        self.progress.done(outcome)
        if self._finished:
            self._finished(job, outcome)
        return outcome

    async def _turn(self, job: Job, cores: int, attempt: Callable[[], Awaitable[Outcome]]) -> Outcome | None:
        """The outcome of an attempt with some cores, in its turn; None when no further one was to begin."""
        try:
            async with self._cores.take(cores):
                self._waiting.remove(job)
                if self._stop or self.interrupted:
                    return None
                return await attempt()
        except asyncio.CancelledError:
            return None
        except Exception as error:  # noqa: BLE001  (one job must not cost the results of the others)
            return error_outcome(job.plan, self.backends.name, describe(error, job.report))

    async def _again(self, job: Job, first: Outcome) -> Outcome:
        """The outcome of a test for which the machine was too busy."""
        if problem := self._set_aside(job):
            return replace(first, notes=(*first.notes, f"not tried again alone, {problem}"))
        self.progress.phase(job.plan.slug, "trying again alone")
        outcome = await self._outcome(job, alone=True)
        note = f"tried again alone, because the machine was too busy: {first.reason}"
        return replace(outcome, notes=(*first.notes, note, *outcome.notes))

    async def _outcome(self, job: Job, alone: bool = False) -> Outcome:
        """That of the last attempt, after errors up to as many as the policy says; earlier ones stay in the report.

        What a busy machine left undecided is tried again when the test is ``alone``, and not at once.
        """
        notes: tuple[str, ...] = ()
        for left in range(self.policy.retries, -1, -1):
            outcome = await self._attempt(job)
            is_over = outcome.outcome != "error" or (is_undecided(outcome) and not alone)
            if is_over or self.interrupted or not left:
                break
            notes = (*notes, f"attempt {self._made[job.plan.slug]} ended in error: {outcome.reason}")
            if problem := self._set_aside(job):
                notes = (*notes, f"not retried, {problem}")
                break
            self.progress.phase(job.plan.slug, f"retrying after error: {outcome.reason}")
        return replace(outcome, notes=(*notes, *outcome.notes))

    def _set_aside(self, job: Job) -> str:
        """Moves the report of the last attempt into ``attempts/<number>``; why it cannot be, or an empty text."""
        target = job.report / "attempts" / str(self._made[job.plan.slug])
        try:
            entries = [each for each in job.report.iterdir() if each.name != "attempts"]
            target.mkdir(parents=True)
            for entry in entries:
                entry.rename(target / entry.name)
        except FileNotFoundError:  # it reported nothing
            return ""
        except OSError as error:
            return f"because its report cannot be moved: {error.filename}: {error.strerror}"
        return ""

    async def _attempt(self, job: Job) -> Outcome:
        slug, outcome = job.plan.slug, None
        self._made[slug] = self._made.get(slug, 0) + 1
        say = functools.partial(self.progress.phase, slug)

        def forget_pictures() -> None:
            with contextlib.suppress(OSError):
                (job.report / PICTURES_FILE).unlink(missing_ok=True)

        try:
            async with opened(job, say, lambda one: self.backends.open(one, say, self.keep)) as (chosen, backend):
                engine = Engine(chosen.plan, backend, say, forget_pictures)
                outcome, kept = await engine.run(self.keep)
                self.kept.extend(kept)
                if job.plan.pool:
                    outcome = replace(outcome, notes=(*outcome.notes, f"ran on rig '{chosen.plan.rig}'"))
        except Exception as error:  # noqa: BLE001  (whatever it is, it concerns this test alone)
            if outcome is None:
                return error_outcome(job.plan, self.backends.name, describe(error, job.report))
            return replace(
                outcome, notes=(*outcome.notes, f"not all of the test was taken down: {describe(error, job.report)}")
            )
        if outcome.outcome == "passed" and not self.keep:
            forget_pictures()
        return outcome


@contextlib.contextmanager
def _signals_call(react: Callable[[], None]) -> Iterator[None]:
    """SIGINT, SIGTERM and SIGHUP call ``react`` in the event loop, and afterwards do what they did before."""
    loop = asyncio.get_running_loop()
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    for number in _SIGNALS:
        loop.add_signal_handler(number, react)
    try:
        yield
    finally:
        for number, handler in before.items():
            loop.remove_signal_handler(number)
            signal.signal(number, handler)


def is_undecided(outcome: Outcome) -> bool:
    """Whether the machine was too busy to judge."""
    return outcome.machine is not None and outcome.machine.undecided
