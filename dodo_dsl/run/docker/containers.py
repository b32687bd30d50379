"""Tests in containers; apart from the other backends, because its libraries take long to load.

Cameras that containers of DoDo's cannot have are refused.
"""

import asyncio
import contextlib
import secrets
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.backends import Job, Say
from dodo_dsl.run.docker import cleanup
from dodo_dsl.run.docker.backend import DockerBackend, other_subnets
from dodo_dsl.run.docker.client import connect
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.process import host_isolation
from dodo_dsl.run.process.slot import meeting_place
from dodo_dsl.run.protocol import Backend, BackendError
from dodo_dsl.run.rigs.permission import refuse_unattended
from dodo_dsl.run.rigs.session import attended
from dodo_dsl.spec.rig import CAMERA_SOURCE, RPICAM

_FLAG = CAMERA_SOURCE.rpartition(".")[2]


def refuse_rpicam(plan: Plan) -> None:
    """Raises BackendError where a service takes pictures by ``rpicam-vid``, a program of the rig's computer."""
    for service in plan.services:
        if any((flag.name, flag.value) == (_FLAG, RPICAM) for flag in service.flags):
            raise BackendError(
                f"service '{service.name}' needs the program rpicam-vid of the rig's computer, which containers do not "
                "have: use --backend mixed or process"
            )


_Kind = TypeVar("_Kind", bound=DockerBackend)


class Containers:
    """Containers of a Docker engine, each test its own compose project."""

    name = "docker"

    def __init__(self, subnets: Sequence[str], roots: Sequence[Path] = ()) -> None:
        self._subnets = subnets
        self._roots = roots
        self._client: Any = None
        self._pulls: Pulls | None = None
        self._problem = ""

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        try:
            self._client = await asyncio.to_thread(connect)
        except BackendError as error:
            self._problem = str(error)
            return
        self._pulls = Pulls(self._client)
        reaped = await asyncio.to_thread(cleanup.reap_projects, self._client)
        for removed in reaped.removed:
            note(f"removed what a killed run left: {removed}")
        for left in reaped.left:
            note(f"what a killed run left cannot be removed: {left}")

    def close(self) -> None:
        """Does nothing: only the tests' own containers run, and each test removes them."""

    @contextlib.asynccontextmanager
    async def open(self, job: Job, say: Say, keep: bool) -> AsyncIterator[Backend]:
        plan = job.plan
        refuse_rpicam(plan)
        with meeting_place(job.work, keep) as channel, self.project(DockerBackend, job, say, channel) as backend:
            Path(channel).chmod(0o777)  # for users of images; the folder around it is closed
            if plan.isolation == "network" and not plan.is_real:
                yield backend
                return
            async with (
                host_isolation.host_slot(plan, (plan.cid,), say, alone=True) as slot,
                attended(plan, replace(slot, channel=channel), say, self._roots),
            ):
                yield backend

    @contextlib.contextmanager
    def project(self, kind: type[_Kind], job: Job, say: Say, channel: str = "") -> Iterator[_Kind]:
        """A backend of a kind with its own project, and the project's lease; raises BackendError.

        ``channel`` is the folder where services and runner meet, if the engine sees it.
        """
        if self._client is None or self._pulls is None:
            raise BackendError(self._problem)
        plan = job.plan
        refuse_unattended(plan)
        project = f"dodo-{plan.slug}-{secrets.token_hex(3)}"
        lease = leases.try_lease(f"{leases.PROJECT}{project}", {"test": plan.slug})
        assert lease is not None, "a fresh name is free"
        subnets = other_subnets(plan.subnet, self._subnets)
        backend = kind(plan, job.folder, job.report, self._client, self._pulls, project, subnets, say, channel)
        try:
            yield backend
        finally:
            lease.leave() if backend.left_behind else lease.release()
