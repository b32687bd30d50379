"""Processes for the tests of a run: in each test's own namespaces, or on the host, as on a real rig."""

import asyncio
import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.process import host_isolation, leftovers
from dodo_dsl.run.process.commands import own_modules
from dodo_dsl.run.process.fork_server_client import ForkServer, serving
from dodo_dsl.run.process.side import ProcessSide
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import Say
from dodo_dsl.run.sides import Side, WatchedServices

NOT_ROOT = (
    "only root can enter the network of a test's containers: run as root, with --isolation host, or on another backend"
)


def may_enter() -> bool:
    """Whether DoDo's processes can enter namespaces of containers."""
    return os.geteuid() == 0


@dataclass
class Processes:
    """Each test's are in a sandbox; if it ``is_whole``, the application's services are among them.

    The others are as for the backends of a combination.
    """

    isolation: str | None
    descriptors: tuple[int, ...]
    loaded: Callable[[], ForkServer | None]
    is_whole: bool
    _problem: str = ""
    _fork_server: ForkServer | None = None
    _is_apart: bool = True

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        for left in leftovers.reap():
            note(f"removed what a killed run left: {left}")
        forked = [plan for plan in plans if (self.isolation or plan.isolation) == "network"]
        self._fork_server = serving(self.loaded(), own_modules(forked) if forked else None, self.descriptors)
        if not self.is_whole:
            self._problem = "" if may_enter() else NOT_ROOT
            return
        is_needed = self.isolation is None and forked
        if is_needed and (refusal := await host_isolation.isolation_refusal(self._fork_server)):
            remedy = f"{refusal.remedy}; " if refusal.remedy else ""
            way_out = f"{remedy}an application that you trust runs with --isolation host"
            self._problem = f"the application cannot be isolated on this machine: {refusal.why}; {way_out}"
        elif len(forked) < len(plans) or any(plan.is_real for plan in plans):
            why = await asyncio.to_thread(host_isolation.process_namespace_refusal)
            self._is_apart = not why
            if why:
                note(f"what an application starts may outlive its test on the host: {why}")

    def close(self) -> None:
        if self._fork_server is not None:
            self._fork_server.close()

    def problem(self, _plan: Plan, isolation: str) -> str:
        """Why a test cannot run here, in a sentence; empty if it can."""
        return self._problem if isolation == "network" else ""

    @contextlib.contextmanager
    def side(self, watched: WatchedServices, slot: Slot, isolation: str, _say: Say) -> Iterator[Side]:
        fork_server = self._fork_server if isolation == "network" else None
        yield ProcessSide(watched, slot, isolation, fork_server, self._is_apart, self.is_whole)
