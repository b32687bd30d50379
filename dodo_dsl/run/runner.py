"""Several tests at once, each on a backend of its own, and a clean machine whatever happens."""

import asyncio
import os
import secrets
import shutil
import signal
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, Self

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.backends import Backends, Job
from dodo_dsl.run.engine import Engine
from dodo_dsl.run.events import BackendError

BackendName = Literal["process", "docker"]
FOLDER_PREFIX = "dodo-run-"
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Progress(Protocol):
    """Who is told how the run goes."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def note(self, text: str) -> None: ...

    def phase(self, slug: str, text: str) -> None: ...

    def done(self, outcome: Outcome) -> None: ...


def default_backend(plans: Sequence[Plan]) -> BackendName:
    """Processes when every application service says how to start as one, else containers."""
    services = [s for plan in plans for s in plan.application.services]
    return "process" if all(s.process for s in services) else "docker"


@dataclass
class WorkFolder:
    """Where a run's tests are compiled; the next run removes it should this one be killed."""

    path: Path
    lease: leases.Lease
    kept: bool = False

    def __enter__(self) -> Self:
        self.path.mkdir(mode=0o755)
        return self

    def __exit__(self, *_: object) -> None:
        if self.kept:
            self.lease.leave()
        else:
            shutil.rmtree(self.path, ignore_errors=True)
            self.lease.release()


def work_folder() -> WorkFolder:
    """A folder of a fresh name, leased."""
    token = secrets.token_hex(4)
    path = Path(tempfile.gettempdir()).resolve() / f"{FOLDER_PREFIX}{token}"
    lease = leases.try_lease(f"{leases.RUN}{token}", {"folder": str(path)})
    assert lease is not None, "a fresh name is free"
    return WorkFolder(path, lease)


def reap_folders() -> None:
    """Removes the folders of killed runs."""
    for lease, about in leases.orphans(leases.RUN):
        folder = Path(str(about.get("folder", "")))
        if folder.name == f"{FOLDER_PREFIX}{lease.name.removeprefix(leases.RUN)}":
            shutil.rmtree(folder, ignore_errors=True)
        lease.release()


class Runner:
    """Runs jobs, ``parallel`` at a time, in order."""

    def __init__(self, progress: Progress, backends: Backends, parallel: int, keep: bool = False) -> None:
        self.progress = progress
        self.backends = backends
        self.keep = keep
        self.kept: list[str] = []
        self.interrupted = False
        self._places = asyncio.Semaphore(parallel)

    async def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """The outcomes in the order of the jobs; SIGINT, SIGTERM and SIGHUP end all tests with their teardown."""
        await self.backends.prepare([job.plan for job in jobs], self.progress.note)
        tasks = [asyncio.ensure_future(self._one(job)) for job in jobs]
        loop = asyncio.get_running_loop()
        for number in _SIGNALS:
            loop.add_signal_handler(number, self._interrupt, tasks)
        try:
            return list(await asyncio.gather(*tasks))
        finally:
            for number in _SIGNALS:
                loop.remove_signal_handler(number)

    def _interrupt(self, tasks: Sequence["asyncio.Task[Outcome]"]) -> None:
        if not self.interrupted:
            self.interrupted = True
            self.progress.note("interrupted: taking down")
            for task in tasks:
                task.cancel()

    async def _one(self, job: Job) -> Outcome:
        slug = job.plan.slug

        def say(text: str) -> None:
            self.progress.phase(slug, text)

        try:
            async with self._places, self.backends.open(job, say, self.keep) as backend:
                outcome, kept = await Engine(job.plan, backend, say).run(self.keep)
                self.kept.extend(kept)
        except BackendError as error:
            outcome = self._without_answer(job.plan, str(error))
        except OSError as error:
            outcome = self._without_answer(job.plan, f"this machine cannot run the test: {error}")
        except asyncio.CancelledError:
            outcome = self._without_answer(job.plan, "the run was interrupted before this test began")
        self.progress.done(outcome)
        return outcome

    def _without_answer(self, plan: Plan, reason: str) -> Outcome:
        """The outcome of a test that never began."""
        return Outcome(
            name=plan.name,
            slug=plan.slug,
            spec=plan.spec,
            level=plan.level,
            kind=plan.kind,
            outcome="error",
            reason=reason,
            cid=plan.cid,
            seed=plan.seed,
            clock=plan.clock,
            backend=self.backends.name,
        )


def default_parallel() -> int:
    return len(os.sched_getaffinity(0))
