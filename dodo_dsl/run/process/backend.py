"""The process backend: services as local processes in their own sandbox."""

import asyncio
import contextlib
import functools
import os
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import msgspec

from dodo_dsl import atomic
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.opendlv.relay import BUS
from dodo_dsl.plan.added_services import TIME
from dodo_dsl.plan.model import ApplicationService, Plan, PlannedService
from dodo_dsl.run import application_time
from dodo_dsl.run.announce import begin_frame, hearers
from dodo_dsl.run.application_files import application_paths
from dodo_dsl.run.hidden_paths import hidden_paths, own_data
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.outcomes import how_it_ended
from dodo_dsl.run.printed_lines import PrintedLines
from dodo_dsl.run.process.commands import Command, Commands, changes, needed_paths
from dodo_dsl.run.process.confinement import MOST_TRIES, MOUNT_GONE, confinement
from dodo_dsl.run.process.environment import own_environment
from dodo_dsl.run.process.fork_server_client import ForkServer
from dodo_dsl.run.process.sandbox_client import SandboxClient
from dodo_dsl.run.process.slot import Entered, Slot
from dodo_dsl.run.protocol import BackendError, Event, Exited, Lost, Noted, Ready, Unmatched, Unstartable
from dodo_dsl.run.service_output import ServiceOutput
from dodo_dsl.run.service_protocol import Reports
from dodo_dsl.run.start_order import Conditions, in_turn, one_off
from dodo_dsl.spec.model import VIRTUAL

LOG = "sandbox.log"
TIME_READY = b'{"dodo": "ready"}'
"""What gives the application the test's time prints when it does."""
USE_PATIENCE_S = 2.0
PIDS_PATIENCE_S = 5.0
TIME_PATIENCE_S = 10.0
_NO_PROGRAM = "bwrap: execvp "
"""How bubblewrap says that it cannot start the application's program."""


class ProcessBackend:
    """One test in a sandbox; ``folder`` is the compiled test's, ``report`` takes logs and recordings."""

    name = "process"

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        report: Path,
        isolation: str,
        slot: Slot,
        fork_server: ForkServer | None = None,
        is_apart: bool = True,
        events: asyncio.Queue[Event] | None = None,
    ) -> None:
        """``is_apart`` means that on the host, too, the application gets its own process namespace.

        ``events`` is a queue of somebody else's to report to, by default an own one.
        """
        self.plan = plan
        self.report = report
        self.isolation = isolation
        self.is_apart = is_apart
        self.slot = slot
        self.cid = slot.cid
        self._folder = folder
        self._commands = Commands(plan, folder, report, slot)
        self._events: asyncio.Queue[Event] = asyncio.Queue() if events is None else events
        self._lines = PrintedLines(plan, folder, self._note)
        self._outputs: dict[str, ServiceOutput] = {}
        self._reports = Reports(plan, report / "logs", self._events.put_nowait, self._outputs)
        self._pids: dict[str, asyncio.Future[int]] = {}
        """Of what was started, as the test's services see it; cancelled where it could not be."""
        self._conditions = Conditions(plan.application.services, has_health=False)
        self._starts: dict[str, list[Command]] = {}
        """The commands by which each service of the application was started, several where a mount went meanwhile."""
        self._turns: dict[str, asyncio.Task[None]] = {}
        """The services of the application that wait for the end of others."""
        self._time_ready: asyncio.Event | None = None
        """Set when what gives the application the test's time is ready, or has ended."""
        self._has_time = False
        self._exits: list[asyncio.Future[None]] = []
        self._asked: dict[str, asyncio.Future[Any]] = {}
        """What the sandbox is to answer, by what it is asked to do."""
        self._sandbox = SandboxClient(self._take, lambda why: self._events.put_nowait(Lost(why)), fork_server)

    @property
    def is_on_host(self) -> bool:
        return self.isolation == "host"

    async def open(self, container: int = 0) -> None:
        """With a process of a ``container``, in the container's network, IPC namespace and ``/tmp``."""
        needed = [*needed_paths(self.plan, self._folder, self.report), Path(self.slot.channel)]
        if self.plan.clock == VIRTUAL:
            time = await asyncio.to_thread(application_time.built)
            self._commands = replace(self._commands, time=time)
            needed += [time.library.parent, time.agent.parent]
        entered = None if self.is_on_host else Entered.with_own(container, *needed)
        with atomic.appended(self.report / LOG) as log:
            await self._sandbox.open(self.slot, log.fileno(), entered)
        self._reports.listen(Path(self.slot.channel))

    def _take(self, message: dict[str, Any]) -> None:
        if "started" in message:
            self._pids[message["started"]].set_result(message["pid"])
            self._conditions.started(message["started"])
            if message["started"] in self._turns:
                self._events.put_nowait(Ready(message["started"]))
        elif "unstartable" in message:
            self._pids[message["unstartable"]].cancel()
            self._events.put_nowait(Unstartable(message["unstartable"], message["why"]))
            self._conditions.failed(message["unstartable"])
        elif asked := self._asked.keys() & message.keys():
            for what in asked:
                self._asked.pop(what).set_result(message[what])
        elif "exited" in message:
            self._exits.append(asyncio.ensure_future(self._exited(**message)))

    async def _exited(self, exited: str, code: int, used: int, failed: bool) -> None:
        """Reports an exit after the last output has been read, so that no verdict follows it."""
        output = self._outputs.get(exited)
        if output is not None:
            with contextlib.suppress(TimeoutError):  # a child of the service may still hold its output open
                await asyncio.wait_for(output.done.wait(), 1.0)
        await self._reports.ended(exited)
        if exited == TIME:
            if self._time_ready:
                self._time_ready.set()
            if self._has_time and code not in (0, application_time.PAGE_DESTROYED):  # which the clock says
                self._events.put_nowait(Lost(f"what gives the application the test's time {how_it_ended(code)}"))
            return
        if failed:
            said = " ".join(self.tail(exited)[-1:])
            starts = self._starts[exited]
            if self.is_on_host and MOUNT_GONE.match(said) and len(starts) < MOST_TRIES:
                self._start(starts[-1])
                return
            why = f"its sandbox cannot be set up: {said or f'exit code {code}'}"
            if said.startswith(_NO_PROGRAM):
                why = said.removeprefix(_NO_PROGRAM)
            self._events.put_nowait(Unstartable(exited, why))
            self._conditions.failed(exited)
            return
        if used:
            most = self.plan.application.limits.memory
            text = f"application service '{exited}' used {used / 1e6:,.0f} MB of memory, at most {most / 1e6:,.0f}"
            self._events.put_nowait(Noted(f"{text} (sandbox: memory in dodo.yml)"))
        self._events.put_nowait(Exited(exited, code, out_of_memory=used > 0))
        self._conditions.ended(exited, code)

    async def start(self, layer: str) -> dict[str, bool]:
        if layer == "application":
            await self.connect(self._lines)
        if layer == "application" and self.plan.clock == VIRTUAL:
            await self._start_time()
        commands = []
        for service in self._services(layer):
            try:
                commands.append(self._commands.of(service))
            except EnvironmentProblem as error:
                self._events.put_nowait(Unstartable(service.name, str(error)))
        by_name = {command.name: command for command in commands}
        for name in self._conditions.in_order(by_name):
            if self._conditions.waits_for_ends(name):
                failed = functools.partial(self._not_started, name)
                self._turns[name] = in_turn(self._start_in_turn(by_name[name]), failed)
            else:
                self._start(by_name[name])
        ready = {*self._turns} - one_off(self.plan.application.services)
        return {name: layer != "application" or name in ready for name in by_name}

    async def _start_time(self) -> None:
        """Starts what gives the application the test's time; raises BackendError."""
        if not self._is_confined:
            raise BackendError(
                "clock: virtual needs process namespaces, which this machine refuses: dodo doctor says why"
            )
        for service in self.plan.application.services:
            with contextlib.suppress(EnvironmentProblem, IndexError):  # it is reported when the service is started
                command = self._commands.of(service)
                if why := application_time.refusal(service.name, command.argv[0], command.environment, command.folder):
                    raise BackendError(why)
        self._time_ready = asyncio.Event()
        self._start(self._commands.of_time(self.is_on_host))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(TIME_PATIENCE_S):
                await self._time_ready.wait()
        if not self._has_time:
            said = " ".join(self.tail(TIME)[-1:]) or f"{TIME} does not start"
            raise BackendError(f"the application cannot be given the test's time: {said}")

    async def connect(self, lines: PrintedLines) -> None:
        """Lets the runner, and ``lines``, send on the test's bus; raises BackendError."""
        if not await self._ask("relay", cid=self.slot.cid, folder=self.slot.channel):
            raise BackendError("nothing can be sent to the test's services: the sandbox does not reach its bus")
        lines.connect(self._send)
        self._reports.stop_listening()

    def _send(self, data: bytes, to: Sequence[str] = (BUS,)) -> None:
        self._sandbox.send({"do": "send", "to": to, "data": data.hex()})

    def _note(self, text: str) -> None:
        self._events.put_nowait(Noted(text))

    def _not_started(self, name: str, why: str) -> None:
        self._events.put_nowait(Unstartable(name, why))
        self._conditions.failed(name)

    async def _start_in_turn(self, command: Command) -> None:
        """Starts a service of the application when others have ended."""
        if why := await self._conditions.unmet(command.name, {}, lambda text: self._events.put_nowait(Noted(text))):
            self._not_started(command.name, why)
        else:
            self._start(command)

    def _services(self, layer: str) -> tuple[PlannedService | ApplicationService, ...]:
        return self.plan.application.services if layer == "application" else self.plan.layer(layer)

    def _start(self, command: Command) -> None:
        def on_line(line: bytes) -> bool:
            if command.layer == "application":
                if command.name in self._lines.services:
                    self._lines.take(command.name, line)
                return False
            if command.name != TIME:
                return self._reports.take(command.name, line)
            if is_ready := line == TIME_READY and self._time_ready is not None:
                self._has_time = True
                self._time_ready.set()
            return is_ready

        self._starts.setdefault(command.name, []).append(command)
        if command.name in self._outputs:  # it is started once more
            self._outputs[command.name].close()
        output = self._outputs[command.name] = self._output(command, on_line)
        self._pids[command.name] = asyncio.get_running_loop().create_future()
        hidden = command.masked if self.isolation == "host" and self.is_apart else ()
        words = {"argv": command.argv, "cwd": str(command.folder), "fork": command.is_module, "masked": hidden}
        try:
            message = {"do": "start", "id": command.name, "confined": self._confined(command), **words}
            self._sandbox.send({**message, "env": changes(own_environment(), command.environment)}, (output.writer,))
        except ValueError as error:
            self._events.put_nowait(Unstartable(command.name, str(error)))
        output.release_writer()

    def _output(self, command: Command, on_line: Callable[[bytes], bool]) -> ServiceOutput:
        """On a terminal where its lines are messages: into a pipe, programs write many lines at once, and late."""
        log = self.report / "logs" / f"{command.layer}.{command.name}.log"
        if command.layer == "application" and command.name in self._lines.services:
            try:
                return ServiceOutput(log, on_line, terminal=True)
            except OSError as error:
                why = f"no pseudo terminal is available ({error.strerror}), and programs often print late into a pipe"
                self._note(f"'{command.name}' prints into a pipe: {why}")
        return ServiceOutput(log, on_line)

    @property
    def _is_confined(self) -> bool:
        return self.isolation != "host" or self.is_apart

    def _confined(self, command: Command) -> dict[str, Any] | None:
        """How an application's process is kept apart; None for DoDo's own services."""
        if command.layer != "application" or not self._is_confined:
            return None
        application = self.plan.application
        hidden = [] if self.is_on_host else self._hidden
        limits = application.limits
        if self._commands.time is not None:
            limits = replace(limits, reads=(*limits.reads, str(self._commands.time.library)))
        confined = confinement(command.folder, limits, hidden)
        confined = replace(confined, channel=self.slot.channel if self.is_on_host else "")
        if self._has_time:
            confined = replace(confined, time=self._commands.time_folder)
        return asdict(replace(confined, masked=command.masked))

    @functools.cached_property
    def _hidden(self) -> list[Path]:
        """What it never sees, and what lies around its folder: its repository, the folders of this test."""
        application = self.plan.application
        known = hidden_paths(application, self._folder, self.report)
        roots = application_paths(application, self._folder).roots
        return [*known, *own_data(), *roots, self._folder.resolve(), self.report.resolve()]

    async def next_event(self) -> Event:
        return await self._events.get()

    async def begin(self) -> None:
        pids = [self._pids[s.name] for s in self.plan.application.services if s.name in self._pids]
        if pids:
            await asyncio.wait(pids, timeout=PIDS_PATIENCE_S)
        application = [pid.result() for pid in pids if pid.done() and not pid.cancelled()]
        self._send(begin_frame(self.plan.seed, application), hearers(self.plan))

    async def listeners(self) -> Collection[str] | None:
        """As the sandbox sees them; None when it does not answer."""
        found: list[str] | None = await self._ask("listeners")
        return found

    async def use(self) -> Snapshot | None:
        """As the sandbox sees it; None when it does not answer."""
        names = [service.name for service in self.plan.application.services]
        return msgspec.convert(await self._ask("use", names=names), Snapshot | None)

    async def _ask(self, what: str, **words: object) -> Any:
        """What the sandbox answers; None when it does not."""
        if what not in self._asked:
            self._asked[what] = asyncio.get_running_loop().create_future()
            self._sandbox.send({"do": what, **words})
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(USE_PATIENCE_S):  # wait_for of Python 3.11 may miss that it is cancelled
                return await asyncio.shield(self._asked[what])
        return None

    async def application(self) -> Collection[int] | None:
        """The sandbox, which DoDo's own services descend from, too; nothing leaves its process namespace."""
        return [self._sandbox.pid] if self._sandbox.pid and self._is_confined else None

    async def close(self, keep: bool) -> list[str]:
        for turn in self._turns.values():
            turn.cancel()
        if keep and (pid := self._sandbox.pid):
            self._reports.stop_listening()
            return self._kept(pid)
        await self._sandbox.close()
        self._reports.close()
        for output in self._outputs.values():
            output.close()
        await asyncio.gather(*self._exits, return_exceptions=True)
        log = self.report / LOG
        if log.is_file() and log.stat().st_size == 0:
            log.unlink(missing_ok=True)
        return []

    def _kept(self, pid: int) -> list[str]:
        outputs = [output.hand_over() for output in self._outputs.values() if not output.done.is_set()]
        for output in self._outputs.values():
            if output.done.is_set():
                output.close()
        self._sandbox.keep((*(reader for reader, _ in outputs), *(log for _, log in outputs)))
        look = f"ps -f --ppid {pid}"
        if self.isolation == "network":
            user = "" if os.getuid() == 0 else "-U --preserve-credentials "
            with contextlib.suppress(OSError, IndexError):  # the kernel does not list children
                inner = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0]
                look = f"nsenter {user}-t {inner} -n -i -m -p bash"
        memory = f", shared memory '{self.slot.memory_prefix}*'" if self.slot.memory_prefix else ""
        return [
            f"{self.plan.slug} is kept running: CID {self.slot.cid}{memory}, logs in {self.report / 'logs'}",
            f"look inside:  {look}",
            f"take it down: kill {pid}",
        ]

    def tail(self, service: str) -> list[str]:
        output = self._outputs.get(service)
        return output.tail() if output else []

    def unmatched(self) -> tuple[Unmatched, ...]:
        return self._lines.unmatched({name: output.unfinished for name, output in self._outputs.items()})
