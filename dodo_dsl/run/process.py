"""The process backend: services as local processes in a sandbox of their own."""

import asyncio
import contextlib
import errno
import json
import os
import select
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from dodo_dsl.plan.model import ApplicationService, Plan, Service
from dodo_dsl.run import lines
from dodo_dsl.run.announce import begin_frame
from dodo_dsl.run.commands import Command, Commands, Lane, changes, package_path
from dodo_dsl.run.environment import MissingVariable
from dodo_dsl.run.events import BackendError, Event, Exited, Lost, Unstartable
from dodo_dsl.run.output import Output

__all__ = ["Lane", "ProcessBackend", "package_path"]

_CLOSE_S = 10.0


class ProcessBackend:
    """One test in a sandbox; ``folder`` is the compiled test's, ``report`` takes logs and recordings."""

    name = "process"

    def __init__(self, plan: Plan, folder: Path, report: Path, isolation: str, lane: Lane) -> None:
        self.plan = plan
        self.report = report
        self.isolation = isolation
        self.lane = lane
        self._commands = Commands(plan, folder, report, lane)
        self.cid = lane.cid
        self._events: asyncio.Queue[Event] = asyncio.Queue()
        self._outputs: dict[str, Output] = {}
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None
        self._closing = False
        self._up: asyncio.Future[dict[str, Any]] | None = None

    async def open(self) -> None:
        loop = asyncio.get_running_loop()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        self._channel, self._up = ours, loop.create_future()
        self.report.mkdir(parents=True, exist_ok=True)
        with theirs, (self.report / "sandbox.log").open("wb") as stderr:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "dodo_dsl.run.sandbox", str(theirs.fileno()), self.isolation],
                pass_fds=(theirs.fileno(), *self.lane.descriptors),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=stderr,
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": package_path(), "DODO_LANE": self.lane.name},
            )
        loop.add_reader(ours, self._hear)
        answer = await self._up
        if "down" in answer:
            raise BackendError(f"no sandbox of isolation {self.isolation}: {answer['down']}")

    def _hear(self) -> None:
        assert self._channel is not None
        try:
            data = self._channel.recv(1 << 17)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._heard(json.loads(data))
            return
        asyncio.get_running_loop().remove_reader(self._channel)
        self._resolve({"down": "it ended at once"})
        if not self._closing:
            self._events.put_nowait(Lost("the test's sandbox ended unexpectedly"))

    def _resolve(self, answer: dict[str, Any]) -> None:
        if self._up is not None and not self._up.done():
            self._up.set_result(answer)

    def _heard(self, message: dict[str, Any]) -> None:
        if "up" in message or "down" in message:
            self._resolve(message)
        elif "unstartable" in message:
            self._events.put_nowait(Unstartable(message["unstartable"], message["why"]))
        elif "exited" in message:
            task = asyncio.ensure_future(self._exited(message["exited"], message["code"]))
            task.add_done_callback(lambda t: t.exception())

    async def _exited(self, name: str, code: int) -> None:
        """An end counts when its last output has been read, so that no verdict comes after it."""
        output = self._outputs.get(name)
        if output is not None:
            with contextlib.suppress(TimeoutError):  # a child of the service may still hold its output open
                await asyncio.wait_for(output.done.wait(), 1.0)
        self._events.put_nowait(Exited(name, code))

    def _send(self, message: dict[str, Any], descriptors: tuple[int, ...] = ()) -> None:
        assert self._channel is not None
        try:
            self._send_patiently(self._channel, json.dumps(message).encode(), descriptors)
        except OSError as error:
            self._events.put_nowait(Lost(f"the test's sandbox cannot be reached: {error.strerror}"))

    @staticmethod
    def _send_patiently(channel: socket.socket, data: bytes, descriptors: tuple[int, ...]) -> None:
        """Sends one message; a sandbox that is busy starting processes is waited for, one that hangs is not."""
        deadline = time.monotonic() + _CLOSE_S
        while True:
            try:
                socket.send_fds(channel, [data], list(descriptors))
            except BlockingIOError:
                left = deadline - time.monotonic()
                if left <= 0:
                    raise OSError(errno.ETIMEDOUT, f"it has read nothing for {_CLOSE_S:g} s") from None
                select.select([], [channel], [], left)
            else:
                return

    async def start(self, layer: str) -> dict[str, bool]:
        commands = []
        for service in self._services(layer):
            try:
                commands.append(self._commands.of(service))
            except MissingVariable as error:
                self._events.put_nowait(Unstartable(service.name, str(error)))
        for command in commands:
            self._start(command)
        return {command.name: layer != "application" for command in commands}

    def _services(self, layer: str) -> tuple[Service | ApplicationService, ...]:
        return self.plan.application.services if layer == "application" else self.plan.layer(layer)

    def _start(self, command: Command) -> None:
        def on_line(line: bytes) -> bool:
            event = None
            if command.layer != "application":
                event = lines.read_line(command.name, command.judge, line)
            if event is not None:
                self._events.put_nowait(event)
            return event is not None

        output = Output(self.report / "logs" / f"{command.layer}.{command.name}.log", on_line)
        self._outputs[command.name] = output
        order = {"do": "start", "id": command.name, "argv": command.argv, "cwd": str(command.folder)}
        self._send({**order, "env": changes(os.environ, command.environment)}, (output.writer,))
        output.release_writer()

    async def next_event(self) -> Event:
        return await self._events.get()

    async def begin(self) -> None:
        self._send({"do": "send", "cid": self.lane.cid, "data": begin_frame(self.plan.seed).hex()})

    async def close(self, keep: bool) -> list[str]:
        if self._process is None or self._channel is None:
            return []
        self._closing = True
        if keep and self._process.poll() is None:
            return self._kept()
        self._send({"do": "close"})
        await asyncio.get_running_loop().run_in_executor(None, self._end_process, self._process)
        asyncio.get_running_loop().remove_reader(self._channel)
        self._channel.close()
        for output in self._outputs.values():
            output.close()
        log = self.report / "sandbox.log"
        if log.is_file() and log.stat().st_size == 0:
            log.unlink(missing_ok=True)
        return []

    @staticmethod
    def _end_process(process: subprocess.Popen[bytes]) -> None:
        try:
            process.wait(_CLOSE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _kept(self) -> list[str]:
        assert self._process is not None
        outputs = [output.hand_over() for output in self._outputs.values() if not output.done.is_set()]
        self._send({"do": "keep"}, (*(reader for reader, _ in outputs), *(log for _, log in outputs)))
        pid = self._process.pid
        look = f"ps -f --ppid {pid}"
        if self.isolation == "network":
            inner = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
            look = f"nsenter {'' if os.getuid() == 0 else '-U --preserve-credentials '}-t {inner[0]} -n -i -m -p bash"
        memory = f", shared memory '{self.lane.memory_prefix}*'" if self.lane.memory_prefix else ""
        return [
            f"{self.plan.slug} is kept up: CID {self.lane.cid}{memory}, logs in {self.report / 'logs'}",
            f"look inside:  {look}",
            f"take it down: kill {pid}",
        ]

    def tail(self, service: str) -> list[str]:
        output = self._outputs.get(service)
        return output.tail() if output else []
