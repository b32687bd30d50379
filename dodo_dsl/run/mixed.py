"""The mixed backend: the application in containers, DoDo's services as processes that share network and memory.

It prepares once for a run, and makes one backend for each test. A container holds a test's network, IPC namespace and
``/tmp``: it runs a program of this machine, and no image.
"""

import asyncio
import contextlib
import os
import secrets
import shutil
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.plan.added_services import TIME
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.run import application_time
from dodo_dsl.run.backends import Job, Say
from dodo_dsl.run.docker.backend import DockerBackend
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.container_use import ELSEWHERE, first_process
from dodo_dsl.run.docker.containers import Containers
from dodo_dsl.run.docker.mounts import over
from dodo_dsl.run.docker.shared_files import IMAGE
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.process import host_isolation, leftovers, namespaces
from dodo_dsl.run.process.backend import ProcessBackend
from dodo_dsl.run.process.commands import needed_paths, own_modules
from dodo_dsl.run.process.fork_server_client import ForkServer, serving
from dodo_dsl.run.process.slot import Entered, Slot, meeting_place
from dodo_dsl.run.protocol import Backend, BackendError, Event, Unmatched
from dodo_dsl.run.rigs.session import attended
from dodo_dsl.spec.model import VIRTUAL

_SEEN = ("/bin", "/lib", "/lib64", "/usr")
"""Folders of this machine that hold the program and its libraries."""


def on_machine(compiled: dict[str, Any], *words: str) -> dict[str, Any]:
    """A container as it is ``compiled``, which does what the ``words`` say with this machine's programs."""
    kept = {key: value for key, value in compiled.items() if key not in ("command", "depends_on")}
    return {**kept, "image": IMAGE, "entrypoint": [*words], "volumes": [*compiled["volumes"], *_folders()]}


def _program(name: str) -> str:
    return shutil.which(name, path=os.defpath) or f"/bin/{name}"


def _folders() -> list[dict[str, Any]]:
    """The mounts of this machine's programs."""
    seen = [folder for folder in _SEEN if Path(folder).is_dir()]
    return [{"type": "bind", "source": folder, "target": folder, "read_only": True} for folder in seen]


_TMP = "tmp"


class ApplicationCompose(Compose):
    """The compiled test without DoDo's services; under network isolation with a container that holds its network."""

    layers = ()

    def _own_images(self) -> set[str]:
        return set()

    def document(self) -> dict[str, Any]:
        """With the containers that DoDo adds, which have programs of this machine; nothing waits for DoDo's services.

        Mounts lie over the folders in ``/tmp`` where DoDo's processes have theirs: so no container removes them.
        """
        made = super().document()
        compiled = yaml.load((self.folder / f"{LAYERS[0]}.compose.yml").read_bytes(), yaml.CSafeLoader)
        services = {name: made["services"][name] for name in self.services}
        own: dict[str, Any] = {}
        if FILES in made["services"]:
            copies = compiled["services"][FILES]
            shell, *words = copies["entrypoint"]
            copies = {**copies, "volumes": over(copies["volumes"], made["services"][FILES].get("volumes", ()))}
            own[FILES] = on_machine(copies, _program(shell), *words)
        volumes = dict(made.get("volumes") or {})
        if self.plan.isolation == "network":
            own[SANDBOX] = self._holder(compiled["services"][SANDBOX])
            volumes[_TMP] = compiled["volumes"][_TMP]
            if self.plan.clock == VIRTUAL:
                place = escaped(str(application_time.built().library.parent))
                volumes[TIME] = {"driver_opts": {"type": "none", "o": "bind", "device": place}}
        needed = [*needed_paths(self.plan, self.folder, self.report), Path(self.channel)]
        shown = Entered.with_own(0, *needed).shown if SANDBOX in own else ()
        mounts = covers(shown)
        for service in services.values():
            after = service.get("depends_on") or {}
            service["depends_on"] = {name: how for name, how in after.items() if name in services or name in own}
            service["volumes"] = over(mounts, service.get("volumes", ()))
        networks = {"networks": compiled["networks"]} if "networks" in compiled else {}
        return {**made, **networks, "services": {**services, **own}, "volumes": volumes}

    def _holder(self, compiled: dict[str, Any]) -> dict[str, Any]:
        """It lets the application's time go on where that is the test's, with what this machine has built."""
        words = compiled["command"] if self.plan.clock == VIRTUAL else [_program("sleep"), "infinity"]
        return {**on_machine(compiled, *words), "user": "65534:65534"}


def covers(shown: Iterable[Path]) -> list[dict[str, Any]]:
    """Empty folders over those that processes of DoDo mount in the test's ``/tmp`` and shared memory, as mounts.

    The kernel removes and renames no folder on which something is mounted in the namespace of the caller, at any
    path. So each service of the application needs them, as one without ``/tmp`` may reach another's; at a path that no
    image knows, so that no symbolic link of an image leads them elsewhere.
    """
    apart = Path(f"/.dodo-{secrets.token_hex(8)}")
    tmp, memory = namespaces.SHARED
    folders = [path for path in shown if path.is_dir() and not path.is_symlink()]  # as only these are mounted
    places = [{tmp: apart, memory: memory}[path.parent] / path.name for path in folders]
    mounts: list[dict[str, Any]] = [
        {"type": "tmpfs", "target": escaped(str(place)), "read_only": True} for place in places
    ]
    if apart in {place.parent for place in places}:
        options = {"read_only": True, "volume": {"nocopy": True}}
        mounts.insert(0, {"type": "volume", "source": _TMP, "target": str(apart), **options})
    return mounts


_OWN_MEMORY = "a folder below /dev/shm: remove that mount, or keep the repository and what the test needs elsewhere"


def uncovered(attributes: Mapping[str, Any]) -> str:
    """What a container mounts in the place of shared memory, so that covers are none there; empty if they are."""
    folders = {mount["Destination"] for mount in attributes.get("Mounts") or ()}
    folders |= set(attributes["HostConfig"].get("Tmpfs") or ())
    memory = namespaces.SHARED[1]
    own = [str(folder) for folder in (memory.parent, memory) if str(folder) in folders]
    return own[0] if own and any(Path(folder).parent == memory for folder in folders) else ""


class ApplicationContainers(DockerBackend):
    """The docker backend without DoDo's services; ``process`` is that of the holder, 0 on the host's network."""

    compose_kind = ApplicationCompose
    process = 0

    async def _connect(self) -> None:
        """Does nothing: the processes do."""

    @property
    def events(self) -> asyncio.Queue[Event]:
        """What has happened, for another backend to add to."""
        return self._events

    async def open(self) -> None:
        await super().open()
        for service in self.plan.application.services:
            container = self._containers.get(service.name)
            if container is not None and (name := uncovered(container.attrs)):
                raise BackendError(f"service '{service.name}' mounts {name} itself, and the test needs {_OWN_MEMORY}")
        if SANDBOX in self._containers:
            self.process = await asyncio.to_thread(self._find_process, self._containers[SANDBOX])

    @staticmethod
    def _find_process(container: Any) -> int:
        process = first_process(container)
        if process is None:
            raise BackendError(f"{ELSEWHERE}, whose network DoDo's processes cannot enter; use --backend docker")
        if not process:
            state = container.attrs["State"]
            why = state.get("Error") or f"exit code {state.get('ExitCode')}"
            raise BackendError(f"the container that holds the test's network ended at once: {why}")
        return process


_APPLICATION = "application"


class MixedBackend:
    """One test: two backends, each with its part of the services; they report to one queue."""

    name = "mixed"

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
        if layer == _APPLICATION:
            await self._processes.connect(self._containers.lines)
        return await (self._containers if layer == _APPLICATION else self._processes).start(layer)

    async def next_event(self) -> Event:
        return await self._containers.next_event()

    async def listeners(self) -> Collection[str] | None:
        return await self._containers.listeners()

    async def begin(self) -> None:
        await self._containers.require_own_host()
        await self._processes.begin()

    async def use(self) -> Snapshot | None:
        """What both have used; the load of the machine is measured if both know it."""
        own, application = await asyncio.gather(self._processes.use(), self._containers.use())
        if own is None or application is None:
            return application and replace(application, busy_s=None)
        busy_s = None if application.busy_s is None else own.busy_s
        return replace(own, services={**own.services, **application.services}, busy_s=busy_s)

    async def application(self) -> Collection[int] | None:
        return await self._containers.application()

    async def close(self, keep: bool) -> list[str]:
        kept = await asyncio.gather(self._processes.close(keep), self._containers.close(keep))
        return [line for lines in kept for line in lines]

    def unmatched(self) -> tuple[Unmatched, ...]:
        return self._containers.unmatched()

    def tail(self, service: str) -> list[str]:
        return (self._containers if service in self._application else self._processes).tail(service)


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
        with (
            meeting_place(job.work, keep) as channel,
            self._containers.project(ApplicationContainers, job, say, channel) as containers,
        ):
            if plan.isolation == "network":
                slot = Slot(plan.cid, descriptors=self._descriptors, channel=channel)
                yield self._backend(job, containers, slot)
                return
            async with (
                host_isolation.host_slot(plan, (plan.cid,), say, keep, alone=True) as leased,
                attended(plan, replace(leased, channel=channel), say, self._roots) as descriptors,
            ):
                slot = replace(leased, descriptors=(*descriptors, *self._descriptors), channel=channel)
                yield self._backend(job, containers, slot)

    def _backend(self, job: Job, containers: ApplicationContainers, slot: Slot) -> MixedBackend:
        plan = job.plan
        own = ProcessBackend(
            plan, job.folder, job.report, plan.isolation, slot, self._fork_server, events=containers.events
        )
        return MixedBackend(containers, own)
