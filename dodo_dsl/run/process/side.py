"""The side of a test whose services are local processes, in their own sandbox."""

import asyncio
import contextlib
import json
import os
import select
import signal
import socket
import struct
import subprocess
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from dodo_dsl import atomic
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.opendlv.relay import BUS
from dodo_dsl.plan.added_services import TIME
from dodo_dsl.plan.model import HEALTHY, LAYERS, STARTED, Plan
from dodo_dsl.run import application_time
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.printed_lines import Send
from dodo_dsl.run.process import host_isolation, leftovers
from dodo_dsl.run.process.commands import Commands, needed_paths, own_module
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.fork_server import ForkServer, python
from dodo_dsl.run.process.sandbox import MAX_MESSAGE
from dodo_dsl.run.process.slot import SLOT_VARIABLE, Entered, Slot, in_memory
from dodo_dsl.run.protocol import BackendError, Ready, Say
from dodo_dsl.run.service_output import ServiceOutput
from dodo_dsl.run.sides import APPLICATION, Side, WatchedServices

LOG = "sandbox.log"
_TIME_READY = b'{"dodo": "ready"}'
"""What gives the application the test's time prints when it does."""
USE_PATIENCE_S, CONNECT_PATIENCE_S = 2.0, 30.0
SEND_S, END_S = 10, 10.0
"""How long a sandbox may take for a message, and to end."""
_OUTPUT_S = 1.0
_COPY = ("cat",)
"""What goes on writing the log of a service that is kept."""
_NO_PROGRAM = "bwrap: execvp "
"""How bubblewrap says that it cannot start the application's program."""


NOT_ROOT = (
    "only root can enter the network of a test's containers: run as root, with --isolation host, or on another backend"
)


def may_enter() -> bool:
    """Whether DoDo's processes can enter namespaces of containers."""
    return os.geteuid() == 0


@dataclass
class Processes:
    """Processes for the tests of a run; if it ``is_whole``, the application's services are among them.

    ``fork_server`` is one that was started while tests were compiled.
    """

    isolation: str | None
    fork_server: ForkServer | None
    is_whole: bool
    _problem: str = ""
    _is_apart: bool = True

    async def prepare(self, plans: Sequence[Plan], note: Say) -> None:
        for left in leftovers.reap():
            note(f"removed what a killed run left: {left}")
        forked = [plan for plan in plans if (self.isolation or plan.isolation) == "network"]
        if forked and self.fork_server is None:
            self.fork_server = ForkServer()
        if not self.is_whole:
            self._problem = "" if may_enter() else NOT_ROOT
        elif forked and (why := await asyncio.to_thread(host_isolation.isolation_refusal)):
            way_out = "an application that you trust runs with --isolation host"
            self._problem = f"the application cannot be isolated on this machine: {why}; {way_out}"
        elif len(forked) < len(plans) or any(plan.is_real for plan in plans):
            why = await asyncio.to_thread(host_isolation.isolation_refusal, on_host=True)
            self._is_apart = not why
            if why:
                note(f"what an application starts may outlive its test on the host: {why}")

    def close(self) -> None:
        if self.fork_server is not None:
            self.fork_server.close()

    def problem(self, _plan: Plan, isolation: str) -> str:
        """Why a test cannot run here, in a sentence; empty if it can."""
        return self._problem if isolation == "network" else ""

    @contextlib.contextmanager
    def side(self, watched: WatchedServices, slot: Slot, isolation: str, _say: Say) -> Iterator[Side]:
        server = self.fork_server if isolation == "network" else None
        yield ProcessSide(watched, slot, server, self._is_apart, self.is_whole)


class ProcessSide:
    """One test's sandbox, and what runs in it."""

    def __init__(
        self,
        watched: WatchedServices,
        slot: Slot,
        fork_server: ForkServer | None,
        is_apart: bool,
        is_whole: bool,
    ) -> None:
        """Without a ``fork_server`` it is on the host, where the application has its own processes if it ``is_apart``.

        If it ``is_whole``, the application's services run here.
        """
        self._watched = watched
        self._plan, self._folder, self._report = watched.plan, watched.folder, watched.report
        self._slot = slot
        self._fork_server, self._is_on_host = fork_server, fork_server is None
        self._gives_time, self._has_time = is_whole and self._plan.lockstep is not None, False
        self._commands = Commands(self._plan, self._folder, self._report, slot, self._is_on_host, is_apart)
        self._exits: list[asyncio.Future[None]] = []
        self._asked: dict[str, asyncio.Future[Any]] = {}
        """What the sandbox is to answer, by what it is asked to do."""
        self._pid = 0
        """The sandbox's process while it runs, and a descriptor that shows its end."""
        self._end = -1
        self._child: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None
        self._closing = False

    async def open(self, entered: int = 0) -> int:
        needed = [*needed_paths(self._plan, self._folder, self._report), Path(self._slot.channel)]
        if self._gives_time:
            needed += await self._open_time()
        self._commands = replace(self._commands, by_answers=self._watched.by_answers)
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", SEND_S, 0))  # it may be busy
        with theirs, atomic.appended(self._report / LOG) as log:
            if self._fork_server is not None:
                modules = {own_module(service.process) for service in self._plan.services} - {""}
                descriptors = [theirs.fileno(), log.fileno(), *self._slot.descriptors]
                self._fork_server.fork(Entered.with_own(entered, *needed), modules, descriptors)
            else:
                name, held = {SLOT_VARIABLE: self._slot.name}, self._slot.descriptors
                self._child = python("dodo_dsl.run.process.sandbox", theirs, held, log, **name)
        loop = asyncio.get_running_loop()
        self._socket.setblocking(False)
        said = await loop.sock_recv(self._socket, MAX_MESSAGE)
        self._socket.setblocking(True)
        answer: dict[str, Any] = json.loads(said) if said else {"down": "it ended at once"}
        if "up" not in answer:
            raise BackendError(f"the test's sandbox does not start: {answer['down']}")
        loop.add_reader(self._socket, self._receive)
        self._pid = answer["up"]
        with contextlib.suppress(ProcessLookupError):
            self._end = os.pidfd_open(self._pid)
        self._watched.reports.listen(Path(self._slot.channel))
        return 0

    def _receive(self) -> None:
        assert self._socket is not None
        data = b""
        try:
            data = self._socket.recv(MAX_MESSAGE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            pass
        if data:
            self._take(json.loads(data))
            return
        asyncio.get_running_loop().remove_reader(self._socket)
        self._pid = 0
        if not self._closing:
            self._watched.lose("the test's sandbox ended unexpectedly")

    def _tell(self, do: str, *descriptors: int, **words: object) -> None:
        """Sends the sandbox a message."""
        assert self._socket is not None
        try:
            socket.send_fds(self._socket, [json.dumps({"do": do, **words}).encode()], descriptors)
        except OSError as error:
            why = f"it has read nothing for {SEND_S} s" if isinstance(error, BlockingIOError) else error.strerror
            self._watched.lose(f"the test's sandbox cannot be reached: {why}")

    def _take(self, message: dict[str, Any]) -> None:
        if name := message.get("started"):
            for condition in (STARTED, HEALTHY):  # as nothing asks for its health
                self._watched.conditions.decide(name, condition)
            if self._watched.conditions.of(name):
                self._watched.tell(Ready(name))
        elif name := message.get("unstartable"):
            self._watched.not_started(name, message["why"])
        elif asked := self._asked.keys() & message.keys():
            for what in asked:
                self._asked.pop(what).set_result(message[what])
        elif "exited" in message:
            self._exits.append(asyncio.ensure_future(self._exited(**message)))

    async def _exited(self, exited: str, code: int, used: int, failed: bool) -> None:
        await self._watched.last_output(exited, _OUTPUT_S)
        if self._has_time and exited == TIME and code in (0, application_time.PAGE_DESTROYED):  # which the clock says
            return
        if failed:
            said = " ".join(self._watched.tail(exited)[-1:])
            why = f"its sandbox cannot be set up: {said or f'exit code {code}'}"
            if said.startswith(_NO_PROGRAM):
                why = said.removeprefix(_NO_PROGRAM)
            self._watched.not_started(exited, why)
            return
        if used:
            most = self._plan.application.limits.memory
            text = f"application service '{exited}' used {used / 1e6:,.0f} MB of memory, at most {most / 1e6:,.0f}"
            self._watched.note(f"{text} (sandbox: memory in dodo.yml)")
        self._watched.ended(exited, code, out_of_memory=used > 0)

    async def start(self, layer: str) -> dict[str, bool]:
        commands = {}
        if self._gives_time and layer == LAYERS[0]:
            commands[TIME] = self._commands.of_time()
        for service in self._watched.of(layer):
            try:
                commands[service.name] = self._commands.of(service)
            except EnvironmentProblem as error:
                self._watched.not_started(service.name, str(error))

        async def start(name: str) -> None:
            self._start(commands[name])

        return await self._watched.start(commands, start, () if layer == APPLICATION else commands)

    async def _open_time(self) -> list[Path]:
        """The folders of what gives the application the test's time; none where it cannot have that."""
        try:
            self._require_loadable()
            time = await asyncio.to_thread(application_time.built)
        except BackendError as error:
            self._gives_time = False
            self._watched.await_answers(str(error))
            return []
        self._commands = replace(self._commands, time=time)
        return [time.library.parent, time.agent.parent]

    def _require_loadable(self) -> None:
        """Raises BackendError where a program of the application cannot load DoDo's library."""
        if not self._commands.is_confined:
            raise BackendError("process namespaces are refused by this machine: dodo doctor says why")
        for service in self._plan.application.services:
            with contextlib.suppress(EnvironmentProblem, IndexError):  # it is reported when the service is started
                command = self._commands.of(service)
                if why := application_time.refusal(
                    service.name, command.argv[0], command.environment, Path(command.folder)
                ):
                    raise BackendError(why)

    def _take_of_time(self, line: bytes) -> bool:
        if line != _TIME_READY:
            return False
        self._has_time = True
        self._watched.tell(Ready(TIME))
        return True

    async def connect(self) -> Send:
        if not await self._ask("relay", CONNECT_PATIENCE_S, cid=self._slot.cid, folder=self._slot.channel):
            raise BackendError("nothing can be sent to the test's services: the sandbox does not reach its bus")
        return self._send

    def _send(self, data: bytes, to: Sequence[str] = (BUS,)) -> None:
        self._tell("send", to=to, data=data.hex())

    def _start(self, command: Command) -> None:
        try:
            output = self._output(command)
        except OSError as error:
            if error.filename or not self._watched.prints(command.name):
                raise
            self._watched.not_started(command.name, f"no pseudo terminal is available: {error.strerror}")
            return
        with in_memory(json.dumps(asdict(command)).encode()) as file:  # which may be longer than a message
            self._tell("start", output.writer, file.fileno())
        output.release_writer()

    def _output(self, command: Command) -> ServiceOutput:
        """On a terminal where its lines are messages: into a pipe, programs write many lines at once, and late."""
        if command.layer == APPLICATION and self._watched.prints(command.name):
            return self._watched.output(command.layer, command.name, terminal=True)
        take = self._take_of_time if command.name == TIME else None
        return self._watched.output(command.layer, command.name, take)

    async def listeners(self) -> Collection[str] | None:
        """As the sandbox sees them; None when it does not answer."""
        found: list[str] | None = await self._ask("listeners")
        return found

    async def use(self) -> Snapshot | None:
        """As the sandbox sees it; None when it does not answer."""
        names = [service.name for service in self._plan.application.services]
        return msgspec.convert(await self._ask("use", names=names), Snapshot | None)

    async def _ask(self, what: str, patience_s: float = USE_PATIENCE_S, **words: object) -> Any:
        """What the sandbox answers; None when it does not."""
        if what not in self._asked:
            self._asked[what] = asyncio.get_running_loop().create_future()
            self._tell(what, **words)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(patience_s):  # wait_for of Python 3.11 may miss that it is cancelled
                return await asyncio.shield(self._asked[what])
        return None

    async def application(self) -> Collection[int] | None:
        """The sandbox, which DoDo's own services descend from, too; nothing leaves its process namespace."""
        return [self._pid] if self._pid and self._commands.is_confined else None

    async def close(self, keep: bool) -> list[str]:
        self._closing = True
        if keep and self._pid:
            return self._kept(self._pid)
        if self._socket is not None:
            await self._end_sandbox(self._socket)
        await asyncio.gather(*self._exits, return_exceptions=True)
        log = self._report / LOG
        if log.is_file() and log.stat().st_size == 0:
            log.unlink(missing_ok=True)
        return []

    async def _end_sandbox(self, channel: socket.socket) -> None:
        """With everything in it."""
        if self._end >= 0:
            self._tell("close")
            await asyncio.to_thread(self._wait)
            with contextlib.suppress(OSError):
                while data := channel.recv(MAX_MESSAGE, socket.MSG_DONTWAIT):  # how the last of them ended
                    self._take(json.loads(data))
        asyncio.get_running_loop().remove_reader(channel)
        channel.close()

    def _wait(self) -> None:
        """Returns when the sandbox has ended, which is killed where it does not end by itself."""
        if not select.select([self._end], [], [], END_S)[0]:
            signal.pidfd_send_signal(self._end, signal.SIGKILL)
            select.select([self._end], [], [])
        os.close(self._end)
        if self._child is not None:
            self._child.wait()

    def _kept(self, pid: int) -> list[str]:
        running = [name for name, output in self._watched.outputs.items() if not output.done.is_set()]
        for reader, log in (self._watched.outputs.pop(name).hand_over() for name in running):
            os.set_blocking(reader, True)
            subprocess.Popen(_COPY, stdin=reader, stdout=log, stderr=subprocess.DEVNULL, start_new_session=True)
        self._tell("keep")
        look = f"ps -f --ppid {pid}"
        if not self._is_on_host:
            user = "" if os.getuid() == 0 else "-U --preserve-credentials "
            with contextlib.suppress(OSError, IndexError):  # the kernel does not list children
                inner = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0]
                look = f"nsenter {user}-t {inner} -n -i -m -p bash"
        memory = f", shared memory '{self._slot.memory_prefix}*'" if self._slot.memory_prefix else ""
        return [
            f"{self._plan.slug} is kept running: CID {self._slot.cid}{memory}, logs in {self._report / 'logs'}",
            f"look inside:  {look}",
            f"take it down: kill {pid}",
        ]
