"""The docker backend: the containers that ``docker compose`` creates, watched by the engine's events."""

import asyncio
import contextlib
import ipaddress
import os
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.plan.added_services import RECORDER
from dodo_dsl.plan.model import HEALTHY, READY_S, Plan
from dodo_dsl.run.announce import begin_frame, hearers
from dodo_dsl.run.application_time import PAGE_DESTROYED
from dodo_dsl.run.docker import shared_files
from dodo_dsl.run.docker.cleanup import PROJECT_LABEL, SERVICE_LABEL, take_down, writers
from dodo_dsl.run.docker.client import TOO_SLOW, engine_error
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.docker.container_use import ELSEWHERE, ContainerUse
from dodo_dsl.run.docker.events import EventWatch
from dodo_dsl.run.docker.line_relay import ContainerRelay, attached, copy_into
from dodo_dsl.run.docker.pulls import Pulls, Say
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.printed_lines import PrintedLines
from dodo_dsl.run.protocol import BackendError, Event, Exited, Lost, Noted, Ready, Unmatched, Unstartable
from dodo_dsl.run.service_output import ServiceOutput
from dodo_dsl.run.service_protocol import Reports
from dodo_dsl.run.start_order import LONGEST_S, Conditions, in_turn, one_off, optional
from dodo_dsl.spec.model import VIRTUAL

_KILLED = 128 + signal.SIGKILL
"""The exit code of a container whose program was killed by a signal that it cannot refuse."""
_MEMORY_TURNS, _MEMORY_TURN_S = 20, 0.05
"""How often, and how long each time, the engine's word is awaited that it was for memory: it may come late."""

_COPY_S = 600.0
"""The longest that copies of the repository's files may take."""
_HOST_TURNS, _HOST_TURN_S = 20, 0.05
"""How often, and how long each time, a container's process is looked for on this machine."""


class DockerBackend:
    """One test as its own compose project; ``subnets`` are tried in turn until the engine accepts one."""

    name = "docker"
    compose_kind: type[Compose] = Compose

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        report: Path,
        client: Any,
        pulls: Pulls,
        project: str,
        subnets: Iterable[str],
        say: Say,
        channel: str = "",
    ) -> None:
        """``channel`` is the folder where services and runner meet, if the engine sees it."""
        self.plan = plan
        self.cid = plan.cid
        self.report = report
        self.project = project
        self._folder = folder
        self._client = client
        self._pulls = pulls
        self._subnets = subnets
        self._say = say
        self._events: asyncio.Queue[Event] = asyncio.Queue()
        self._compose = self.compose_kind(plan, folder, report, project, say, channel)
        self._application = tuple(service.name for service in plan.application.services)
        self._containers: dict[str, Any] = {}
        self._use = ContainerUse({})
        self.lines = PrintedLines(plan, folder, lambda text: self._events.put_nowait(Noted(text)))
        """What the application's containers print."""
        self._relay: ContainerRelay | None = None
        self._outputs: dict[str, ServiceOutput] = {}
        self._reports = Reports(plan, report / "logs", self._events.put_nowait, self._outputs)
        self._out_of_memory: set[str] = set()
        self._is_closing = False
        self._kills: set[asyncio.Future[None]] = set()
        self._watch = EventWatch(self._take, lambda why: self._events.put_nowait(Lost(why)))
        self._copied, self._copy_problem = asyncio.Event(), ""
        self._conditions = Conditions(plan.application.services)
        self._may_be_ill = one_off(plan.application.services) | optional(plan.application.services)
        self._turns: set[asyncio.Task[None]] = set()
        """The services of the application that wait for others."""
        self.left_behind = False

    @property
    def is_on_host(self) -> bool:
        return self.plan.isolation == "host"

    async def open(self) -> None:
        if self.plan.clock == VIRTUAL and self.is_on_host:
            raise BackendError(
                "clock: virtual needs a network of the test's own where the application runs in containers: "
                "remove 'isolation: host', or run with --backend process"
            )
        await asyncio.to_thread(self._compose.read)
        await self._pulls.once("docker compose", self._compose.require_plugin)
        await self._require_files()
        await self._open_channel()
        await self._compose.provide_images(self._pulls)
        await self._compose.create(self._subnets)
        await self._start_watching()

    async def _require_files(self) -> None:
        """Raises BackendError where the engine does not see what the test mounts; once for all tests of a run."""
        await self._pulls.once(shared_files.IMAGE, self._provide_empty_image)
        paths = self._compose.mounted()
        others = [str(path) for path in paths if not path.is_relative_to(self._folder)]
        await self._pulls.once(f"files {self._folder.parent} {others}", lambda: self._look_for(paths))

    async def _open_channel(self) -> None:
        """Listens to services; where the engine does not see the folder, they meet in a volume, and print."""
        folder = self._compose.channel
        if not self._compose.layers:  # DoDo's services are no containers
            return
        try:
            if not self.is_on_host:
                await self._pulls.once(f"folder {Path(folder).parent}", lambda: self._look_for([Path(folder)]))
            self._reports.listen(Path(folder))
        except BackendError:
            self._compose.channel = ""
        except OSError as error:
            raise BackendError(f"services cannot reach the runner: {error}") from error

    async def _provide_empty_image(self) -> str:
        await asyncio.to_thread(shared_files.provide_image, self._client)
        return ""

    async def _look_for(self, paths: Sequence[Path]) -> str:
        missing = await asyncio.to_thread(shared_files.unseen, self._client, paths, self.project)
        if missing:
            raise BackendError(": ".join(shared_files.problem(missing)))
        return ""

    async def _start_watching(self) -> None:
        from docker.errors import DockerException

        try:
            self._containers = await asyncio.to_thread(self._find_containers)
            self._use = ContainerUse(self._containers, self._application)
            self._require_health()
            await asyncio.to_thread(self._watch.begin, self._client, self.project)
            for name in (SANDBOX, FILES):
                if name in self._containers:
                    await asyncio.to_thread(self._start_container, name)
        except (DockerException, OSError) as error:
            raise BackendError(f"the Docker engine cannot start the test: {engine_error(error)}") from error

    def _find_containers(self) -> dict[str, Any]:
        found = self._client.containers.list(all=True, filters={"label": f"{PROJECT_LABEL}={self.project}"})
        return {c.labels[SERVICE_LABEL]: c for c in found}

    def _require_health(self) -> None:
        """Raises BackendError where a service waits for the health of another one that has no health check."""
        for service in self.plan.application.services:
            for other, condition in service.after.items():
                if condition == HEALTHY and other in self._containers and not healthcheck(self._containers[other]):
                    raise BackendError(
                        f"service '{service.name}' waits for '{other}' to be healthy (depends_on), but neither the "
                        f"compose file nor the image of '{other}' has a healthcheck"
                    )

    def _take(self, name: str, action: str, attributes: Mapping[str, str]) -> None:
        if self._is_closing:
            code = int(attributes.get("exitCode", 0)) if action == "die" else 0
            if code > 128 and code != _KILLED:  # process 1 may not hear SIGTERM, and miss a world that has ended
                self._events.put_nowait(Exited(name, code))
        elif action == "oom":
            self._take_memory_kill(name)
        elif name == FILES:
            self._take_of_copies(action)
        elif action == "health_status: healthy":
            self._conditions.healthy(name)
            self._events.put_nowait(Ready(name))
        elif action == "health_status: unhealthy":
            self._conditions.unhealthy(name)
        elif action == "die" and name in self._outputs:
            task = asyncio.ensure_future(self._died(name, int(attributes.get("exitCode", 1))))
            task.add_done_callback(lambda t: t.exception())
        elif action == "die" and name == SANDBOX and attributes.get("exitCode") == str(PAGE_DESTROYED):
            pass  # the clock says it
        elif action == "die":
            self._events.put_nowait(Lost(f"the test's {name} ended unexpectedly"))

    def _take_memory_kill(self, name: str) -> None:
        """Ends a service of which the kernel killed a process for memory, because it may have been a child."""
        if name in self._outputs and name not in self._out_of_memory:
            self._kills.add(asyncio.ensure_future(asyncio.to_thread(self._kill, name)))
        self._out_of_memory.add(name)

    def _kill(self, name: str) -> None:
        from docker.errors import DockerException

        with contextlib.suppress(DockerException, OSError):  # it has ended
            self._containers[name].kill()

    def _take_of_copies(self, action: str) -> None:
        if action == "health_status: healthy":
            self._copied.set()
        elif action == "die" and not self._copied.is_set():
            task = asyncio.ensure_future(self._not_copied())
            task.add_done_callback(lambda t: t.exception())

    async def _not_copied(self) -> None:
        from docker.errors import DockerException

        said = b""
        with contextlib.suppress(DockerException, OSError):
            said = await asyncio.to_thread(self._containers[FILES].logs, tail=1)
        why = said.decode("utf-8", "replace").strip() or "the program that copies them ended"
        self._copy_problem = f"the application's files cannot be copied: {why}"
        self._copied.set()

    async def _wait_for_copies(self) -> None:
        """Until the application has its own copies of the repository's files; raises BackendError."""
        if FILES not in self._containers:
            return
        try:
            await asyncio.wait_for(self._copied.wait(), _COPY_S)
        except TimeoutError:
            hint = "mount large folders read-only (:ro)"
            raise BackendError(f"the application's files are not copied within {_COPY_S:g} s; {hint}") from None
        if self._copy_problem:
            raise BackendError(self._copy_problem)
        await asyncio.to_thread(self._kill, FILES)

    async def _died(self, name: str, code: int) -> None:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._outputs[name].done.wait(), 2.0)
        await self._reports.ended(name)
        self._events.put_nowait(Exited(name, code, await self._was_out_of_memory(name, code)))
        self._conditions.ended(name, code)

    async def _was_out_of_memory(self, name: str, code: int) -> bool:
        for _ in range(_MEMORY_TURNS):
            if code != _KILLED or name in self._out_of_memory:
                break
            await asyncio.sleep(_MEMORY_TURN_S)
        else:
            return await asyncio.to_thread(self._was_killed_for_memory, name)
        return name in self._out_of_memory

    def _was_killed_for_memory(self, name: str) -> bool:
        from docker.errors import DockerException

        with contextlib.suppress(DockerException, OSError):
            self._containers[name].reload()
            return bool(self._containers[name].attrs["State"].get("OOMKilled"))
        return False

    async def start(self, layer: str) -> dict[str, bool]:
        names = [s.name for s in self.plan.layer(layer)]
        if layer == "application":
            names = [name for name in self._application if name in self._containers]
            await asyncio.gather(self._wait_for_copies(), self._connect())
            self._reports.stop_listening()
        for name in names:
            self._outputs[name] = ServiceOutput(
                self.report / "logs" / f"{layer}.{name}.log",
                self._line_reader(layer, name),
                is_cooked=self._prints(name),
            )
        waiting = [name for name in names if self._conditions.of(name)]
        await asyncio.gather(*(self._start(name) for name in names if name not in waiting))
        self._turns |= {in_turn(self._start_in_turn(name), partial(self._not_started, name)) for name in waiting}
        reports = {name for name in names if layer != "application" or self._compose.has_healthcheck(name)}
        ready = ({*waiting} | reports) - self._may_be_ill
        return {name: name in ready for name in names}

    async def _connect(self) -> None:
        """Lets the runner send to services, and on the test's bus; raises BackendError."""
        from docker.errors import DockerException

        try:
            own = self._containers.get(RECORDER) or self._containers[self.plan.services[0].name]
            self._relay = await asyncio.to_thread(ContainerRelay, own, self.cid)
        except (DockerException, OSError, ValueError) as error:
            raise BackendError(f"nothing can be sent to the test's services: {engine_error(error)}") from error
        self.lines.connect(self._relay.send)

    def _prints(self, name: str) -> bool:
        """Whether what a container prints becomes messages."""
        return name in self.lines.services

    async def _start_in_turn(self, name: str) -> None:
        """Starts a service of the application when what it waits for is so, and then waits for its own health."""
        after = self._conditions.of(name)
        patience = {other: health_patience_s(self._containers[other]) for other in after if other in self._containers}
        try:
            why = await self._conditions.unmet(name, patience, lambda text: self._events.put_nowait(Noted(text)))
        except asyncio.CancelledError:
            self._outputs[name].release_writer()
            raise
        if why:
            self._not_started(name, why)
            return
        await self._start(name)
        if not self._compose.has_healthcheck(name):
            self._events.put_nowait(Ready(name))
            return
        why = await self._conditions.ill(name, health_patience_s(self._containers[name]))
        if why and name not in self._may_be_ill:
            self._events.put_nowait(Unstartable(name, why))

    def _not_started(self, name: str, why: str) -> None:
        self._outputs[name].release_writer()
        self._events.put_nowait(Unstartable(name, why))
        self._conditions.failed(name)

    def _line_reader(self, layer: str, name: str) -> Callable[[bytes], bool]:
        def on_line(line: bytes) -> bool:
            if self._prints(name):
                self.lines.take(name, line)
            return layer != "application" and self._reports.take(name, line)

        return on_line

    async def _start(self, name: str) -> None:
        from docker.errors import DockerException

        try:
            stream = await asyncio.to_thread(self._start_container, name)
        except (DockerException, OSError) as error:
            self._not_started(name, engine_error(error))
            return
        self._conditions.started(name)
        follow, source = (self._follow, self._containers[name]) if stream is None else (copy_into, stream)
        threading.Thread(target=follow, args=(source, self._outputs[name].writer), daemon=True).start()

    def _start_container(self, name: str, again: bool = False) -> Any:
        """Starts a container, if need be twice; what it prints, where that becomes messages."""
        from docker.errors import APIError

        # before its start, because it may end at once; a log comes later than what is attached, and by single bytes
        stream = attached(self._containers[name]) if self._prints(name) else None
        try:
            self._containers[name].start()
        except APIError as error:
            if again or not TOO_SLOW.search(engine_error(error)):
                raise
            self._note(f"the container of '{name}' is started once more: {engine_error(error)}")
            return self._start_container(name, again=True)
        return stream

    @staticmethod
    def _follow(container: Any, writer: int) -> None:
        """Copies a container's output into the pipe of its Output; runs in its own thread.

        It ends with the container, or when nobody reads the pipe any more.
        """
        with contextlib.suppress(Exception), contextlib.closing(container.logs(stream=True, follow=True)) as chunks:
            for chunk in chunks:
                os.write(writer, chunk)
        with contextlib.suppress(OSError):
            os.close(writer)

    async def next_event(self) -> Event:
        return await self._events.get()

    async def listeners(self) -> Collection[str] | None:
        return await asyncio.to_thread(self._use.listeners, self._application, self.cid)

    async def require_own_host(self) -> None:
        """Raises BackendError where the test is on the network of a host that is not this machine.

        The engine shows a service that has just ended as a process that is not here, so it is asked again.
        """
        for _ in range(_HOST_TURNS):
            if not self.is_on_host or await self.application() is not None:
                return
            await asyncio.sleep(_HOST_TURN_S)
        raise BackendError(f"{ELSEWHERE}, on whose network DoDo cannot begin the test; use --isolation network")

    async def begin(self) -> None:
        await self.require_own_host()
        assert self._relay is not None, "the application was started"
        self._relay.send(begin_frame(self.plan.seed), hearers(self.plan))

    async def use(self) -> Snapshot | None:
        return await asyncio.to_thread(self._use.take)

    async def application(self) -> Collection[int] | None:
        return await asyncio.to_thread(self._use.first, self._application)

    async def close(self, keep: bool) -> list[str]:
        self._is_closing = True
        for turn in self._turns:
            turn.cancel()
        await asyncio.gather(*self._turns, return_exceptions=True)
        kept = []
        if keep and self._containers:
            kept = self._kept()
        else:
            await asyncio.to_thread(self._take_down)
        self._watch.close()
        if self._relay is not None:
            self._relay.close()
        self._reports.close()
        for output in self._outputs.values():
            output.close()
        return kept

    def _take_down(self) -> None:
        report = (writers(self.plan), self.report)
        self.left_behind = not take_down(self._client, self.project, self._containers, report, self._note)

    def _note(self, text: str) -> None:
        """Reports a sentence at once, and with the outcome; may be called from any thread."""
        self._say(text)
        self._watch.call_in_loop(self._events.put_nowait, Noted(text))

    def _kept(self) -> list[str]:
        compose = f"docker compose -p {self.project}"
        return [
            f"{self.plan.slug} is kept running as compose project {self.project}",
            f"look inside:  {compose} ps;  {compose} logs camera;  {compose} exec {SANDBOX} bash",
            f"take it down: {compose} down -v",
        ]

    def tail(self, service: str) -> list[str]:
        output = self._outputs.get(service)
        return output.tail() if output else []

    def unmatched(self) -> tuple[Unmatched, ...]:
        return self.lines.unmatched({name: output.unfinished for name, output in self._outputs.items()})


def healthcheck(container: Any) -> dict[str, Any]:
    """The health check of a container, from its compose file or its image; empty without one."""
    check = container.attrs["Config"].get("Healthcheck") or {}
    return {} if (check.get("Test") or ["NONE"]) == ["NONE"] else check


def health_patience_s(container: Any) -> float:
    """How long a container may take to be healthy, in s: beyond all tries that its health check has."""
    check = healthcheck(container)
    interval, timeout = (((check.get(key) or 0) / 1e9) or 30.0 for key in ("Interval", "Timeout"))
    tries = (check.get("StartPeriod") or 0) / 1e9 + (check.get("Retries") or 3) * (interval + timeout)
    return min(tries + READY_S, LONGEST_S)


def other_subnets(first: str, all_subnets: Iterable[str]) -> Iterator[str]:
    """The planned subnet, then the rest of the deployment's of the same size."""
    yield first
    length = int(first.partition("/")[2]) if first else 32
    seen = {first}
    for text in all_subnets:
        network = ipaddress.IPv4Network(text)
        same = str(network.supernet(new_prefix=length)) if length < network.prefixlen else text
        if same not in seen:
            seen.add(same)
            yield same
