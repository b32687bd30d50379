"""Where tests run: each backend is a combination of two sides, prepares once for a run, and is made for each test."""

import asyncio
import contextlib
import tempfile
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.process import host_isolation
from dodo_dsl.run.process.fork_server import ForkServer
from dodo_dsl.run.process.side import Processes
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.run.rigs.ports import refuse_unattended
from dodo_dsl.run.rigs.session import attended
from dodo_dsl.run.sides import Backend, Side, WatchedServices
from dodo_dsl.run.work_folder import meeting_place

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


@dataclass
class CombinedBackends:
    """The backends of a combination, by its ``name``.

    On the host, processes take one of the ``cids``; ``subnets`` are for networks of containers. ``isolation`` is in
    place of the tests' own. What runs holds the leases of the ``descriptors``, too.
    """

    name: str
    cids: Sequence[int] = ()
    subnets: Sequence[str] = ()
    isolation: str | None = None
    descriptors: tuple[int, ...] = ()
    fork_server: ForkServer | None = None
    _kinds: "list[Processes | Containers]" = field(default_factory=list)
    _is_prepared: bool = False
    _alone: asyncio.Lock = field(default_factory=asyncio.Lock)
    """A queue without time limit for tests of this run that need the machine for themselves."""

    def __post_init__(self) -> None:
        self._own, self._application = COMBINATIONS[self.name]
        is_whole = self._own == self._application
        if self._own == PROCESSES:
            self._kinds.append(Processes(self.isolation, self.fork_server, is_whole))
        if self._application == CONTAINERS:
            from dodo_dsl.run.docker.containers import Containers

            self._kinds.append(Containers(self.subnets, is_whole))

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        """Called before each round of tests, of which the first counts."""
        for kind in () if self._is_prepared else self._kinds:
            await kind.prepare(plans, note)
        self._is_prepared = True

    def close(self) -> None:
        for kind in self._kinds:
            if isinstance(kind, Processes):
                kind.close()

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Say, keep: bool) -> AsyncIterator[Backend]:
        """A backend for one test; raises BackendError when none is available."""
        plan = job.plan
        isolation = "host" if plan.is_real else self.isolation or plan.isolation
        refuse_unattended(plan)
        for kind in self._kinds:
            if problem := kind.problem(plan, isolation):
                raise BackendError(problem)
        watched = WatchedServices(plan, job.folder, job.report)
        async with contextlib.AsyncExitStack() as stack:
            channel = stack.enter_context(meeting_place(job.work, keep))
            if keep and self._own == CONTAINERS and isolation == "network":
                channel = ""  # of kept containers nobody holds the folder: they meet in their volume
            slot = await stack.enter_async_context(self._slot(plan, isolation, channel, say, keep))
            sides: list[Side] = [stack.enter_context(kind.side(watched, slot, isolation, say)) for kind in self._kinds]
            yield Backend(self.name, slot.cid, isolation == "host", watched, sides[0], sides[-1])

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
            attended(plan, replace(leased, channel=channel), say) as descriptors,
        ):
            yield replace(leased, descriptors=(*descriptors, *self.descriptors), channel=channel)
