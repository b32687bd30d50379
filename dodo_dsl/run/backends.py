"""Where tests run: each kind of backend prepares once for a run, and makes one backend for each test."""

import asyncio
import contextlib
import tempfile
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.process import host_isolation, leftovers
from dodo_dsl.run.process.backend import ProcessBackend
from dodo_dsl.run.process.commands import own_modules
from dodo_dsl.run.process.fork_server_client import ForkServer, serving
from dodo_dsl.run.process.slot import Slot, meeting_place
from dodo_dsl.run.protocol import Backend, BackendError
from dodo_dsl.run.rigs.permission import refuse_unattended
from dodo_dsl.run.rigs.session import RigSession, attended

Say = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """A Plan, the folder that it was compiled into, and the folder for its logs and pictures.

    ``test`` is the slug that all repetitions of a test share. ``others`` are the same test for other rigs, of which any
    will do. ``work`` takes what exists only while it runs.
    """

    plan: Plan
    folder: Path
    report: Path
    test: str = ""
    others: tuple["Job", ...] = ()
    work: Path = field(default_factory=lambda: Path(tempfile.gettempdir()))

    def __post_init__(self) -> None:
        object.__setattr__(self, "test", self.test or self.plan.slug)


class Backends(Protocol):
    """Makes backends; ``prepare`` is called once before the first."""

    name: str

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None: ...

    def close(self) -> None:
        """All tests are over; called once at the end."""
        ...

    def open(self, job: Job, say: Say, keep: bool) -> AbstractAsyncContextManager[Backend]:
        """A backend for one test; raises BackendError when none is available."""
        ...


class Processes:
    """Local processes, each test in its own namespaces, or on the host in a leased slot, as on a real rig."""

    name = "process"
    _fork_server: ForkServer | None = None

    def __init__(
        self,
        cids: Sequence[int],
        isolation: str | None,
        descriptors: tuple[int, ...],
        roots: Sequence[Path] = (),
        loaded: Callable[[], ForkServer | None] = lambda: None,
        session: RigSession | None = None,
    ) -> None:
        """``roots`` are the folders that tests come from, for the permission to use a rig.

        A ``session`` spares rigs that stay fit their checks between tests.

        ``loaded`` gives a fork server that was started with the same ``descriptors`` while tests were compiled.
        """
        self._cids = cids
        self._roots = roots
        self._isolation = isolation
        self._descriptors = descriptors
        self._loaded = loaded
        self._session = session
        self._alone = asyncio.Lock()
        self._problem = ""
        self._is_apart = True

    def _exclusively(self, plan: Plan) -> AbstractAsyncContextManager[None]:
        """A queue without time limit for tests of this run that need the machine for themselves."""
        return self._alone if host_isolation.runs_alone(plan) else contextlib.nullcontext()

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        for left in leftovers.reap():
            note(f"removed what a killed run left: {left}")
        wanted = {self._isolation or plan.isolation for plan in plans}
        self._start_fork_server(plans if "network" in wanted else ())
        is_needed = self._isolation is None and "network" in wanted
        if is_needed and (refusal := await host_isolation.isolation_refusal(self._fork_server)):
            remedy = f"{refusal.remedy}; " if refusal.remedy else ""
            way_out = f"{remedy}an application that you trust runs with --isolation host"
            self._problem = f"the application cannot be isolated on this machine: {refusal.why}; {way_out}"
            return
        if "host" in wanted or any(plan.is_real for plan in plans):
            why = await asyncio.to_thread(host_isolation.process_namespace_refusal)
            self._is_apart = not why
            if why:
                note(f"what an application starts may outlive its test on the host: {why}")

    def _start_fork_server(self, plans: Sequence[Plan]) -> None:
        """One for the services of these tests, none if there are none."""
        self._fork_server = serving(self._loaded(), own_modules(plans) if plans else None, self._descriptors)

    def close(self) -> None:
        if self._fork_server is not None:
            self._fork_server.close()

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Say, keep: bool) -> AsyncIterator[Backend]:
        plan = self._session.at_home(job.plan) if self._session else job.plan
        refuse_unattended(plan)
        isolation = "host" if plan.is_real else self._isolation or plan.isolation
        if isolation == "network" and self._problem:
            raise BackendError(self._problem)
        with meeting_place(job.work, keep) as channel:
            if isolation == "network":
                slot = Slot(plan.cid, descriptors=self._descriptors, channel=channel)
                yield ProcessBackend(plan, job.folder, job.report, isolation, slot, self._fork_server)
                return
            async with (
                self._exclusively(plan),
                host_isolation.host_slot(
                    plan, () if plan.is_real else self._cids, say, keep, alone=host_isolation.runs_alone(plan)
                ) as leased,
                attended(plan, replace(leased, channel=channel), say, self._roots, self._session) as descriptors,
            ):
                slot = replace(leased, descriptors=(*descriptors, *self._descriptors), channel=channel)
                yield ProcessBackend(plan, job.folder, job.report, isolation, slot, is_apart=self._is_apart)
