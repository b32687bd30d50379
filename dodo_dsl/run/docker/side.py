"""The side of a test whose services are containers: ``docker compose`` creates them, the engine's events watch them."""

import asyncio
import contextlib
import re
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from docker.errors import APIError, DockerException

from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.plan.added_services import RECORDER
from dodo_dsl.plan.model import HEALTHY, STARTED
from dodo_dsl.run.application_time import PAGE_DESTROYED, POSIX_MEMORY
from dodo_dsl.run.docker import beside_processes
from dodo_dsl.run.docker.beside_processes import IMAGE
from dodo_dsl.run.docker.cleanup import PROJECT_LABEL, SERVICE_LABEL, take_down
from dodo_dsl.run.docker.client import engine_error, refusal
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.container_use import ContainerUse
from dodo_dsl.run.docker.line_relay import ContainerRelay, attached, close, copy_into, type_into
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.outcomes import unstartable
from dodo_dsl.run.printed_lines import Send
from dodo_dsl.run.protocol import BackendError, Exited, Ready
from dodo_dsl.run.sides import APPLICATION, WatchedServices
from dodo_dsl.run.start_order import LATE, UNHEALTHY

_KILLED = 128 + signal.SIGKILL
"""The exit code of a container whose program was killed by a signal that it cannot refuse."""
_MEMORY_S = 1.0
"""How long the engine's word is awaited that it was for memory: it may come late."""
_OUTPUT_S = 2.0
_TOO_SLOW = re.compile("failed to create shim.*context deadline exceeded")
"""In the error of an engine that was too busy to start a container; it may try again."""


class ContainerSide:
    """One test's compose project; ``subnets`` are tried in turn until the engine accepts one."""

    def __init__(
        self, watched: WatchedServices, compose: Compose, client: Any, pulls: Pulls, subnets: Iterable[str]
    ) -> None:
        self._watched = watched
        self._plan = watched.plan
        self._compose = compose
        self._client = client
        self._pulls = pulls
        self._subnets = subnets
        self._application = tuple(service.name for service in self._plan.application.services)
        self._containers: dict[str, Any] = {}
        self._use = ContainerUse({})
        self._relay: ContainerRelay | None = None
        self._out_of_memory: set[str] = set()
        self._is_closing = False
        self._kills: set[asyncio.Future[None]] = set()
        self._loop = asyncio.get_running_loop()
        self._events: Any = None
        self._note = partial(self._call, watched.note)
        self.left_behind = False

    async def open(self, entered: int = 0) -> int:
        if self._plan.lockstep and self._plan.isolation == "host":
            self._watched.await_answers("containers on the host's network cannot have the test's time")
        await asyncio.to_thread(self._compose.read)
        await self._pulls.once("docker compose", self._compose.require_plugin)
        self._open_channel()
        await self._compose.provide_images(self._pulls)
        if not self._compose.is_whole:
            await self._pulls.once(IMAGE, partial(asyncio.to_thread, beside_processes.provide_image, self._client))
        await self._look_at_programs()
        await self._compose.create(self._subnets)
        await self._start_watching()
        if self._compose.is_whole:
            return 0
        return await asyncio.to_thread(beside_processes.entered, self._containers, self._application)

    def _open_channel(self) -> None:
        if self._compose.is_whole and self._compose.channel:  # else DoDo's services are processes, or meet apart
            try:
                self._watched.reports.listen(Path(self._compose.channel))
            except OSError as error:
                raise BackendError(f"services cannot reach the runner: {error}") from error

    async def _look_at_programs(self) -> None:
        """In lockstep by answers, where a program of the application cannot have the test's time."""
        if self._plan.lockstep is None or self._watched.by_answers:
            return
        for name, service in self._compose.services.items():
            given = (service.get("entrypoint"), service.get("command"))
            words = [opendlv_flags.split(w) if isinstance(w, str) else tuple(map(str, w or ())) for w in given]
            own = service.get("environment") or {}
            variables = {key: str(own[key]) for key in ("PATH", POSIX_MEMORY) if own.get(key)}
            look = partial(self._refusal, name, service["image"], *words, variables)
            why = await self._pulls.once(f"program {name} {service['image']} {words} {variables}", look)
            if why and not self._watched.by_answers:
                self._watched.await_answers(why)
        self._compose.by_answers = self._watched.by_answers

    async def _refusal(self, *words: Any) -> str:
        try:
            return await asyncio.to_thread(refusal, self._client, *words)
        except (DockerException, OSError):  # the clock names a service that never loads the library
            return ""

    async def _start_watching(self) -> None:
        try:
            label = {"label": f"{PROJECT_LABEL}={self._compose.project}"}
            found = await asyncio.to_thread(self._client.containers.list, all=True, filters=label)
            self._containers = {container.labels[SERVICE_LABEL]: container for container in found}
            self._use = ContainerUse(self._containers, self._application)
            self._require_health()
            self._events = await asyncio.to_thread(self._client.events, decode=True, filters=label)
            threading.Thread(target=self._read_events, daemon=True).start()
            for name in (SANDBOX, FILES):
                if name in self._containers:
                    close(await asyncio.to_thread(self._start_container, name))
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine cannot start the test: {engine_error(error)}") from error

    def _require_health(self) -> None:
        """Raises BackendError where a service waits for the health of another one that has no health check."""
        for service in self._plan.application.services:
            for other, condition in service.after.items():
                if condition == HEALTHY and other in self._containers and not healthcheck(self._containers[other]):
                    raise BackendError(
                        f"service '{service.name}' waits for '{other}' to be healthy (depends_on), but neither the "
                        f"compose file nor the image of '{other}' has a healthcheck"
                    )

    def _read_events(self) -> None:
        try:
            for event in self._events:
                attributes = event.get("Actor", {}).get("Attributes", {})
                if name := attributes.get(SERVICE_LABEL):
                    self._call(self._take, name, str(event.get("Action", "")), attributes)
            self._call(self._watched.lose, "the Docker engine went away: its events ended")
        except Exception as error:  # noqa: BLE001  (whatever ended the stream, there are no more events)
            self._call(self._watched.lose, f"the Docker engine went away: {error}")

    def _call(self, work: Callable[..., object], *arguments: Any) -> None:
        """Calls a function in the event loop, from any thread."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(work, *arguments)

    def _take(self, name: str, action: str, attributes: Mapping[str, str]) -> None:
        if self._is_closing:
            code = int(attributes.get("exitCode", 0)) if action == "die" else 0
            if code > 128 and code != _KILLED:  # process 1 may not hear SIGTERM, and miss a world that has ended
                self._watched.tell(Exited(name, code))
        elif action == "oom":
            self._take_memory_kill(name)
        elif action == "health_status: healthy":
            self._watched.conditions.decide(name, HEALTHY)
            self._watched.tell(Ready(name))
        elif action == "health_status: unhealthy":
            self._watched.conditions.decide(name, HEALTHY, UNHEALTHY)
        elif action == "die" and name in self._watched.outputs:
            task = asyncio.ensure_future(self._died(name, int(attributes.get("exitCode", 1))))
            task.add_done_callback(lambda t: t.exception())
        elif action == "die" and name == FILES:
            self._watched.conditions.ended(name, int(attributes.get("exitCode", 1)))
        elif action == "die" and name == SANDBOX and attributes.get("exitCode") == str(PAGE_DESTROYED):
            pass  # the clock says it
        elif action == "die":
            self._watched.lose(f"the test's {name} ended unexpectedly")

    def _take_memory_kill(self, name: str) -> None:
        """Ends a service of which the kernel killed a process for memory, because it may have been a child."""
        if name in self._watched.outputs and name not in self._out_of_memory:
            self._kills.add(asyncio.ensure_future(asyncio.to_thread(self._kill, name)))
        self._out_of_memory.add(name)

    def _kill(self, name: str) -> None:
        with contextlib.suppress(DockerException, OSError):  # it has ended
            self._containers[name].kill()

    async def _wait_for_copies(self) -> None:
        """Until the application has its own copies of the repository's files; raises BackendError."""
        if FILES not in self._containers:
            return
        if why := await self._watched.conditions.why_not(FILES, HEALTHY):
            said = await asyncio.to_thread(_last_line, self._containers[FILES]) or f"the program that does it {why}"
            hint = "; mount large folders read-only (:ro)" if why in (UNHEALTHY, LATE) else ""
            raise BackendError(f"the application's files cannot be copied: {said}{hint}")
        await asyncio.to_thread(self._kill, FILES)

    async def _died(self, name: str, code: int) -> None:
        await self._watched.last_output(name, _OUTPUT_S)
        if code == _KILLED and name not in self._out_of_memory:
            await asyncio.sleep(_MEMORY_S)
            await asyncio.to_thread(self._ask_for_memory_kill, name)
        self._watched.ended(name, code, name in self._out_of_memory)

    def _ask_for_memory_kill(self, name: str) -> None:
        with contextlib.suppress(DockerException, OSError):
            self._containers[name].reload()
            if self._containers[name].attrs["State"].get("OOMKilled"):
                self._out_of_memory.add(name)

    async def start(self, layer: str) -> dict[str, bool]:
        names = [service.name for service in self._watched.of(layer)]
        reports = names
        if layer == APPLICATION:
            names = [name for name in names if name in self._containers]
            reports = [name for name in names if self._compose.has_healthcheck(name)]
            await self._wait_for_copies()

        async def start(name: str) -> None:
            await self._start(layer, name)

        return await self._watched.start(names, start, reports)

    async def connect(self) -> Send:
        own = self._containers.get(RECORDER) or self._containers[self._plan.services[0].name]
        try:
            self._relay = await asyncio.to_thread(ContainerRelay, own.id, self._plan.cid)
        except OSError as error:
            raise BackendError(f"nothing can be sent to the test's services: {error.strerror}") from error
        return self._relay.send

    async def _start(self, layer: str, name: str) -> None:
        """Starts a service; where it waited for others, its own health is awaited, too."""
        has_terminal = bool(self._containers[name].attrs.get("Config", {}).get("Tty"))
        output = self._watched.output(layer, name, is_cooked=has_terminal)
        try:
            printed = await asyncio.to_thread(self._start_container, name)
        except (DockerException, OSError) as error:
            output.release_writer()
            self._watched.not_started(name, engine_error(error))
            return
        self._watched.conditions.decide(name, STARTED)
        if has_terminal and self._watched.prints(name):
            output.type_in = partial(type_into, printed)
        arguments = printed, has_terminal, output.writer
        threading.Thread(target=copy_into, args=arguments, daemon=True).start()
        if not self._watched.conditions.of(name):
            return
        if not self._compose.has_healthcheck(name):
            self._watched.tell(Ready(name))
            return
        why = await self._watched.conditions.why_not(name, HEALTHY)
        if why in (UNHEALTHY, LATE) and name not in self._watched.may_be_ill:  # else it has ended
            self._watched.tell(unstartable(self._plan, name, f"its healthcheck failed: it {why}"))

    def _start_container(self, name: str, again: bool = False) -> Any:
        """Starts a container, if need be twice; what it prints."""
        printed = attached(self._containers[name])  # before its start, because it may end at once
        try:
            self._containers[name].start()
        except APIError as error:
            close(printed)
            if again or not _TOO_SLOW.search(engine_error(error)):
                raise
            self._note(f"the container of '{name}' is started once more: {engine_error(error)}")
            return self._start_container(name, again=True)
        return printed

    async def listeners(self) -> Collection[str] | None:
        return await asyncio.to_thread(self._use.listeners, self._application, self._plan.cid)

    async def use(self) -> Snapshot | None:
        return await asyncio.to_thread(self._use.take)

    async def application(self) -> Collection[int] | None:
        return await asyncio.to_thread(self._use.first, self._application)

    async def close(self, keep: bool) -> list[str]:
        self._is_closing = True
        kept = []
        if keep and self._containers:
            kept = self._kept()
        else:
            await asyncio.to_thread(self._take_down)
        if self._events is not None:
            with contextlib.suppress(Exception):
                self._events.close()
        if self._relay is not None:
            self._relay.close()
        return kept

    def _take_down(self) -> None:
        names = [each.name for each in self._plan.services if any(flag.kind == "report" for flag in each.flags)]
        writers = {name: self._containers[name] for name in names if name in self._containers}
        report = self._watched.report
        self.left_behind = not take_down(self._client, self._compose.project, writers, report, self._note)

    def _kept(self) -> list[str]:
        compose = f"docker compose -p {self._compose.project}"
        return [
            f"{self._plan.slug} is kept running as compose project {self._compose.project}",
            f"look inside:  {compose} ps;  {compose} logs camera;  {compose} exec {SANDBOX} bash",
            f"take it down: {compose} down -v",
        ]


def _last_line(container: Any) -> str:
    with contextlib.suppress(DockerException, OSError):
        return str(container.logs(tail=1).decode("utf-8", "replace").strip())
    return ""


def healthcheck(container: Any) -> dict[str, Any]:
    """The health check of a container, from its compose file or its image; empty without one."""
    check = container.attrs["Config"].get("Healthcheck") or {}
    return {} if (check.get("Test") or ["NONE"]) == ["NONE"] else check
