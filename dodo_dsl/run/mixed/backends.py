"""Where tests of the mixed backend run: prepares once for a run, and makes one backend for each test."""

import contextlib
import os
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import replace
from pathlib import Path

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Job, Say
from dodo_dsl.run.docker.containers import Containers
from dodo_dsl.run.mixed.backend import MixedBackend
from dodo_dsl.run.mixed.containers import ApplicationContainers
from dodo_dsl.run.process import host_isolation, leftovers
from dodo_dsl.run.process.backend import ProcessBackend
from dodo_dsl.run.process.commands import own_modules
from dodo_dsl.run.process.forks.fork_server_client import ForkServer, serving
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import Backend, BackendError
from dodo_dsl.run.rigs.attendance import attended

NOT_ROOT = (
    "only root can enter the network of a test's containers: run as root, with --isolation host, or on another backend"
)


def may_enter() -> bool:
    """Whether DoDo's processes can enter namespaces of containers."""
    return os.geteuid() == 0


class Mixed:
    """The application in containers, DoDo's services as local processes of the installed version."""

    name = "mixed"

    def __init__(
        self,
        containers: Containers,
        descriptors: tuple[int, ...],
        roots: Sequence[Path] = (),
        loaded: Callable[[], ForkServer | None] = lambda: None,
    ) -> None:
        """``roots`` and ``loaded`` are as for Processes."""
        self._containers = containers
        self._descriptors = descriptors
        self._roots = roots
        self._loaded = loaded
        self._fork_server: ForkServer | None = None

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        await self._containers.prepare(plans, note)
        for left in leftovers.reap():
            note(f"removed what a killed run left: {left}")
        forked = [plan for plan in plans if plan.isolation == "network"]
        modules = own_modules(forked) if forked and may_enter() else None
        self._fork_server = serving(self._loaded(), modules, self._descriptors)

    def close(self) -> None:
        if self._fork_server is not None:
            self._fork_server.close()

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Say, keep: bool) -> AsyncIterator[Backend]:
        plan = job.plan
        if plan.isolation == "network" and not may_enter():
            raise BackendError(NOT_ROOT)
        with self._containers.project(ApplicationContainers, job, say, b"") as containers:
            if plan.isolation == "network":
                yield self._backend(job, containers, Slot(plan.cid, descriptors=self._descriptors))
                return
            async with (
                host_isolation.host_slot(plan, (plan.cid,), say, keep, alone=True) as leased,
                attended(plan, leased, say, self._roots) as descriptors,
            ):
                slot = replace(leased, descriptors=(*descriptors, *self._descriptors))
                yield self._backend(job, containers, slot)

    def _backend(self, job: Job, containers: ApplicationContainers, slot: Slot) -> MixedBackend:
        plan = job.plan
        own = ProcessBackend(
            plan, job.folder, job.report, plan.isolation, slot, self._fork_server, events=containers.events
        )
        return MixedBackend(containers, own)
