"""Runs several tests at once, each on a backend of its own, and leaves a clean machine whatever happens."""

import asyncio
import signal
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol, Self

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Backends, Job
from dodo_dsl.run.engine import Engine
from dodo_dsl.run.outcomes import describe, error_outcome, error_reason, system_error
from dodo_dsl.run.schedule import CorePool, Schedule

BackendName = Literal["process", "docker"]
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Progress(Protocol):
    """Shows how the run goes."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def note(self, text: str) -> None: ...

    def phase(self, slug: str, text: str) -> None: ...

    def done(self, outcome: Outcome) -> None: ...

    def rest(self, seconds: float, tests: int) -> None: ...


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
    """Runs jobs, as many at once as ``schedule`` allows, in its order. Times are of the event loop's clock, in s."""

    def __init__(
        self, progress: Progress, backends: Backends, schedule: Schedule, policy: Policy, keep: bool = False
    ) -> None:
        self.progress = progress
        self.backends = backends
        self.schedule = schedule
        self.policy = policy
        self.keep = keep
        self.kept: list[str] = []
        self.interrupted = False
        self.skipped: list[Job] = []
        self._cores = CorePool(schedule.capacity)
        self._waiting: list[Job] = []
        self._began: dict[str, tuple[Job, float]] = {}
        self._stop = False

    async def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """The outcomes in the order of the jobs; SIGINT, SIGTERM and SIGHUP end all tests with their teardown."""
        await self.backends.prepare([job.plan for job in jobs], self.progress.note)
        self._waiting = self.schedule.ordered(jobs)
        tasks = {job.plan.slug: asyncio.ensure_future(self._one(job)) for job in self._waiting}
        loop = asyncio.get_running_loop()
        for number in _SIGNALS:
            loop.add_signal_handler(number, self._interrupt, list(tasks.values()))
        try:
            outcomes = await asyncio.gather(*(tasks[job.plan.slug] for job in jobs))
        finally:
            for number in _SIGNALS:
                loop.remove_signal_handler(number)
            self.backends.close()
        return [outcome for outcome in outcomes if outcome is not None]

    def _interrupt(self, tasks: Sequence["asyncio.Task[Outcome | None]"]) -> None:
        if not self.interrupted:
            self.interrupted = True
            self.progress.note("interrupted: taking down")
            for task in tasks:
                task.cancel()

    async def _one(self, job: Job) -> Outcome | None:
        """A test's outcome, or None when no further test was to begin."""
        try:
            async with self._cores.take(self.schedule.need(job)):
                self._waiting.remove(job)
                if self._stop:
                    self.skipped.append(job)
                    return None
                self._began[job.plan.slug] = (job, _now())
                outcome = await self._with_retries(job)
        except asyncio.CancelledError:
            outcome = error_outcome(job.plan, self.backends.name, "the run was interrupted before this test began")
        except Exception as error:  # noqa: BLE001  (one job must not cost the results of the others)
            outcome = error_outcome(job.plan, self.backends.name, error_reason(error, job.report))
        self._began.pop(job.plan.slug, None)
        self._stop |= self.policy.fail_fast and outcome.outcome != "passed"
        self.progress.done(outcome)
        self._show_rest()
        return outcome

    def _show_rest(self) -> None:
        now = _now()
        running = [(job, now - began) for job, began in self._began.values()]
        if running or self._waiting:
            self.progress.rest(self.schedule.forecast(self._waiting, running), len(running) + len(self._waiting))

    async def _with_retries(self, job: Job) -> Outcome:
        """The outcome of the last attempt; earlier ones are kept in the report, too."""
        notes: tuple[str, ...] = ()
        for attempt in range(1, self.policy.retries + 2):
            outcome = await self._attempt(job)
            if outcome.outcome != "error" or self.interrupted or attempt > self.policy.retries:
                break
            notes = (*notes, f"attempt {attempt} ended in error: {outcome.reason}")
            try:
                set_aside(job.report, attempt)
            except OSError as error:
                notes = (*notes, f"not retried, as its report cannot be moved: {system_error(error)}")
                break
            self.progress.phase(job.plan.slug, f"retrying after error: {outcome.reason}")
        return replace(outcome, notes=(*notes, *outcome.notes))

    async def _attempt(self, job: Job) -> Outcome:
        slug = job.plan.slug

        def say(text: str) -> None:
            self.progress.phase(slug, text)

        outcome = None
        try:
            async with self.backends.open(job, say, self.keep) as backend:
                outcome, kept = await Engine(job.plan, backend, say).run(self.keep)
                self.kept.extend(kept)
        except Exception as error:  # noqa: BLE001  (whatever it is, it concerns this test alone)
            if outcome is None:
                return error_outcome(job.plan, self.backends.name, error_reason(error, job.report))
            return replace(
                outcome, notes=(*outcome.notes, f"not all of the test was taken down: {describe(error, job.report)}")
            )
        return outcome


def _now() -> float:
    return asyncio.get_running_loop().time()


def set_aside(report: Path, attempt: int) -> None:
    """Moves what an attempt reported into ``attempts/<number>`` of the same folder."""
    if not report.is_dir():
        return
    target = report / "attempts" / str(attempt)
    target.mkdir(parents=True)
    for entry in report.iterdir():
        if entry.name != "attempts":
            entry.rename(target / entry.name)
