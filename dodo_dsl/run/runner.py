"""Runs several tests at once, each on its own backend, and leaves a clean machine whatever happens."""

import asyncio
import contextlib
import functools
import itertools
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal, Protocol, Self

from dodo_dsl.application import secret_variables
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.plan.added_services import PICTURES_FILE
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import CombinedBackends, Job
from dodo_dsl.run.engine import Engine
from dodo_dsl.run.outcomes import describe, error_outcome
from dodo_dsl.run.rigs.pool import opened
from dodo_dsl.run.schedule import Schedule

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


class Runner:
    """Runs jobs, as many at once as ``schedule`` allows, in its order.

    With ``fail_fast`` it begins no further ones after one that did not pass; errors have so many ``retries``.
    """

    def __init__(
        self,
        progress: Progress,
        backends: CombinedBackends,
        schedule: Schedule,
        *,
        fail_fast: bool = False,
        retries: int = 0,
        keep: bool = False,
    ) -> None:
        self.progress = progress
        self.backends = backends
        self.schedule = schedule
        self.fail_fast, self.retries, self.keep = fail_fast, retries, keep
        self.interrupted = False
        self.not_run: list[NotRun] = []
        """The tests that never began, in the order in which they would have."""
        self.kept: list[str] = []
        """Sentences on the tests that were left running."""
        self._stop = False
        self._finished: Finished | None = None

    async def run(self, jobs: Sequence[Job], finished: Finished | None = None) -> list[Outcome]:
        """The outcomes in the order of the jobs; SIGINT, SIGTERM and SIGHUP end all tests with their teardown.

        ``finished`` is called for each test as soon as its outcome is final.
        """
        self._finished = finished
        passed = [name for job in jobs for name in job.plan.application.access.passed]
        for text in secret_variables.passed_secrets(os.environ, passed):
            self.progress.note(text)
        await self.backends.prepare([job.plan for job in jobs], self.progress.note)
        tasks = {job.plan.slug: asyncio.ensure_future(self._one(job)) for job in self.schedule.ordered(jobs)}
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
        """A test's outcome, or None when no further test was to begin.

        An error is tried again, alone and behind all that wait: as often as is allowed, and once where the machine
        was too busy. What was before stays in the report.
        """
        notes: tuple[str, ...] = ()
        outcome: Outcome | None = None
        cores = self.schedule.need(job)
        for number in itertools.count(1):
            try:
                async with self.schedule.take(cores):
                    if self._stop or self.interrupted:
                        break
                    if outcome and (problem := _set_aside(job, number - 1)):
                        outcome = replace(outcome, notes=(*outcome.notes, f"not tried again, {problem}"))
                        break
                    latest = await self._attempt(job)
            except asyncio.CancelledError:
                break
            outcome = replace(latest, notes=(*notes, *latest.notes))
            is_undecided = outcome.machine is not None and outcome.machine.undecided
            most = max(self.retries, is_undecided)
            if outcome.outcome != "error" or number > most or self.interrupted or self.keep:
                break
            notes = (*outcome.notes, f"attempt {number} ended in error: {outcome.reason}")
            self.progress.phase(job.plan.slug, f"waiting to be tried again alone, after error: {outcome.reason}")
            cores = self.schedule.capacity
        if outcome is None:
            reason, plan = "the run was interrupted" if self.interrupted else "a test before did not pass", job.plan
            self.not_run.append(NotRun(plan.name, plan.slug, plan.spec, plan.level, reason))
            return None
        self._stop |= self.fail_fast and outcome.outcome != "passed"
        self.progress.done(outcome)
        if self._finished:
            self._finished(job, outcome)
        return outcome

    async def _attempt(self, job: Job) -> Outcome:
        outcome = None
        say = functools.partial(self.progress.phase, job.plan.slug)

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


def _set_aside(job: Job, number: int) -> str:
    """Moves the report of an attempt into ``attempts/<number>``; why it cannot be, or an empty text."""
    target = job.report / "attempts" / str(number)
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
