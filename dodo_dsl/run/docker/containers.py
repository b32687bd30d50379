"""Containers for the tests of a run, on an engine; apart from processes, because its libraries take long to load."""

import asyncio
import contextlib
import ipaddress
import secrets
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.check.spec_rules import SMALLEST
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.docker import cleanup
from dodo_dsl.run.docker.client import connect
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.docker.side import ContainerSide
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.run.sides import Side, WatchedServices


class Containers:
    """Each test's are a compose project; if it ``is_whole``, DoDo's services are among them."""

    def __init__(self, subnets: Sequence[str], is_whole: bool) -> None:
        self._subnets = subnets
        self._is_whole = is_whole
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
        removed, left = await asyncio.to_thread(cleanup.reap_projects, self._client)
        for text in removed:
            note(f"removed what a killed run left: {text}")
        for text in left:
            note(f"what a killed run left cannot be removed: {text}")

    def problem(self, _plan: Plan, _isolation: str) -> str:
        """Why a test cannot run here, in a sentence; empty if it can."""
        return self._problem

    @contextlib.contextmanager
    def side(self, watched: WatchedServices, slot: Slot, _isolation: str, say: Say) -> Iterator[Side]:
        """One with its own project, and the project's lease."""
        if self._is_whole and slot.channel:
            Path(slot.channel).chmod(0o777)  # for users of images; the folder around it is closed
        assert self._pulls is not None, "there is no problem"
        plan = watched.plan
        project = f"dodo-{plan.slug}-{secrets.token_hex(3)}"
        lease = leases.try_lease(f"{leases.PROJECT}{project}", {"test": plan.slug})
        assert lease is not None, "a fresh name is free"
        compose = Compose(plan, watched.folder, watched.report, project, say, slot.channel, self._is_whole)
        subnets = other_subnets(plan.subnet, self._subnets)
        side = ContainerSide(watched, compose, self._client, self._pulls, subnets)
        try:
            yield side
        finally:
            lease.leave() if side.left_behind else lease.release()


def other_subnets(first: str, networks: Iterable[str]) -> Iterator[str]:
    """The planned subnet, then the rest of the deployment's networks of the same size."""
    yield first
    length = int(first.partition("/")[2]) if first else SMALLEST
    for network in map(ipaddress.IPv4Network, networks):
        parts = network.subnets(new_prefix=max(length, network.prefixlen))
        yield from (text for part in parts if (text := str(part)) != first)
