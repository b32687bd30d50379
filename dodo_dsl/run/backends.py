"""Where tests run: each backend is a combination of two sides, prepares once for a run, and is made for each test."""

import asyncio
import contextlib
import tempfile
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.process import host_isolation
from dodo_dsl.run.process.fork_server_client import ForkServer
from dodo_dsl.run.process.processes import Processes
from dodo_dsl.run.process.slot import Slot, meeting_place
from dodo_dsl.run.protocol import Backend, BackendError, Say
from dodo_dsl.run.rigs.permission import refuse_unattended
from dodo_dsl.run.rigs.session import RigSession, attended
from dodo_dsl.run.sides import Side, Sides, WatchedServices

if TYPE_CHECKING:
    from dodo_dsl.run.docker.containers import Containers

PROCESSES, CONTAINERS = "processes", "containers"
COMBINATIONS = {
    "process": (PROCESSES, PROCESSES),
    "docker": (CONTAINERS, CONTAINERS),
    "mixed": (PROCESSES, CONTAINERS),
}
"""What DoDo's side is, and the application's, by the name of the backend.

Containers of DoDo's cannot enter the network of an application's processes.
"""


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


@dataclass
class CombinedBackends:
    """The backends of a combination, by its ``name``.

    On the host, processes take one of the ``cids``; ``subnets`` are for networks of containers. ``isolation`` is in
    place of the tests' own. ``roots`` are the folders that tests come from, for the permission to use a rig. A
    ``session`` spares rigs that stay fit their checks between tests. ``loaded`` gives a fork server that was started
    with the same ``descriptors`` while tests were compiled.
    """

    name: str
    cids: Sequence[int] = ()
    subnets: Sequence[str] = ()
    isolation: str | None = None
    descriptors: tuple[int, ...] = ()
    roots: Sequence[Path] = ()
    loaded: Callable[[], ForkServer | None] = lambda: None
    session: RigSession | None = None
    _processes: Processes | None = None
    _containers: "Containers | None" = None
    _alone: asyncio.Lock = field(default_factory=asyncio.Lock)
    """A queue without time limit for tests of this run that need the machine for themselves."""

    def __post_init__(self) -> None:
        self._own, self._application = COMBINATIONS[self.name]
        if self._own == PROCESSES:
            has_application = self._application == PROCESSES
            self._processes = Processes(self.isolation, self.descriptors, self.loaded, has_application)
        if self._application == CONTAINERS:
            from dodo_dsl.run.docker.containers import Containers

            self._containers = Containers(self.subnets, has_own=self._own == CONTAINERS)

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        if self._containers is not None:
            await self._containers.prepare(plans, note)
        if self._processes is not None:
            await self._processes.prepare(plans, note)

    def close(self) -> None:
        if self._processes is not None:
            self._processes.close()

    def _refuse(self, plan: Plan, isolation: str) -> None:
        """Raises BackendError for a test that cannot run here."""
        refuse_unattended(plan)
        problem = self._containers.problem(plan) if self._containers is not None else ""
        if self._processes is not None and isolation == "network":
            problem = problem or self._processes.problem
        if problem:
            raise BackendError(problem)

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Say, keep: bool) -> AsyncIterator[Backend]:
        plan = self.session.at_home(job.plan) if self.session else job.plan
        isolation = "host" if plan.is_real else self.isolation or plan.isolation
        self._refuse(plan, isolation)
        watched = WatchedServices(plan, job.folder, job.report)
        async with contextlib.AsyncExitStack() as stack:
            channel = stack.enter_context(meeting_place(job.work, keep))
            if self._own == CONTAINERS:
                Path(channel).chmod(0o777)  # for users of images; the folder around it is closed
            slot = await stack.enter_async_context(self._slot(plan, isolation, channel, say, keep))
            sides: list[Side] = []
            if self._processes is not None:
                sides.append(self._processes.side(watched, slot, isolation))
            if self._containers is not None:
                sides.append(stack.enter_context(self._containers.side(watched, say, channel)))
            yield Sides(self.name, slot.cid, isolation == "host", watched, sides[0], sides[-1])

    @contextlib.asynccontextmanager
    async def _slot(self, plan: Plan, isolation: str, channel: str, say: Say, keep: bool) -> AsyncIterator[Slot]:
        """What keeps a test apart, with the rig's leases; on the host for as long as it runs, and a kept one lives."""
        if isolation == "network":
            yield Slot(plan.cid, descriptors=self.descriptors, channel=channel)
            return
        is_fixed = self._application == CONTAINERS
        alone, cids = is_fixed or host_isolation.runs_alone(plan), () if is_fixed or plan.is_real else self.cids
        if self._own == CONTAINERS:
            keep = False  # nobody of it could hold the leases
        async with (
            self._alone if alone else contextlib.nullcontext(),
            host_isolation.host_slot(plan, cids, say, keep, alone=alone) as leased,
            attended(plan, replace(leased, channel=channel), say, self.roots, self.session) as descriptors,
        ):
            yield replace(leased, descriptors=(*descriptors, *self.descriptors), channel=channel)
