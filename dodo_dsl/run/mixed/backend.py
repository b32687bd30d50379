"""The mixed backend: the application in containers, DoDo's services as processes that share network and memory."""

import asyncio
from collections.abc import Collection, Mapping
from dataclasses import replace

from dodo_dsl.run.load.service_use import Used
from dodo_dsl.run.load.snapshot import Snapshot
from dodo_dsl.run.mixed.containers import ApplicationContainers
from dodo_dsl.run.process.backend import ProcessBackend
from dodo_dsl.run.protocol import Event

_APPLICATION = "application"


class MixedBackend:
    """One test: two backends, each with its part of the services; they report to one queue."""

    name = "mixed"
    has_engine = True

    def __init__(self, containers: ApplicationContainers, processes: ProcessBackend) -> None:
        self.cid = processes.cid
        self._containers, self._processes = containers, processes
        self._application = {service.name for service in processes.plan.application.services}

    @property
    def is_on_host(self) -> bool:
        return self._containers.is_on_host

    async def open(self) -> None:
        await self._containers.open()
        await self._processes.open(self._containers.process)

    async def start(self, layer: str) -> dict[str, bool]:
        return await (self._containers if layer == _APPLICATION else self._processes).start(layer)

    async def next_event(self) -> Event:
        return await self._containers.next_event()

    async def listeners(self) -> Collection[str] | None:
        return await self._containers.listeners()

    async def begin(self) -> None:
        await self._containers.require_own_host()
        await self._processes.begin()

    async def load(self) -> Snapshot | None:
        """What both have used; None where one of them cannot tell."""
        own, application = await asyncio.gather(self._processes.load(), self._containers.load())
        if own is None or application is None:
            return None
        return replace(own, services={**own.services, **application.services})

    async def use(self) -> Mapping[str, Used] | None:
        return await self._containers.use()

    async def application(self) -> Collection[int] | None:
        return await self._containers.application()

    async def close(self, keep: bool) -> list[str]:
        kept = await asyncio.gather(self._processes.close(keep), self._containers.close(keep))
        return [line for lines in kept for line in lines]

    def tail(self, service: str) -> list[str]:
        return (self._containers if service in self._application else self._processes).tail(service)
