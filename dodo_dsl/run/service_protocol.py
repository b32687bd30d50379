"""What services report to the runner: JSON over the channel of a test, or lines of output by hand."""

import asyncio
import contextlib
import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from dodo_dsl import atomic
from dodo_dsl.log_times import JUDGED_SUFFIX
from dodo_dsl.opendlv.packets import RUNNER_SOCKET, Connection, Listener
from dodo_dsl.outcome import with_margin
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.protocol import (
    Event,
    Finding,
    GivenVerdict,
    Late,
    Message,
    Noted,
    Ready,
    VerdictEvent,
)
from dodo_dsl.run.service_output import ServiceOutput

JUDGED = b'{"dodo": "judged"'
_MAX_RECORD = 16 << 20
_PATIENCE_S = 1.0
_decoder: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)


def read(service: str, is_evaluator: bool, message: bytes) -> Event | None:
    """The event that a message is, or None; only evaluators give verdicts."""
    text = message.strip()
    if not text.startswith(b"{") or b'"dodo"' not in text or text.startswith(JUDGED):
        return None
    is_verdict = b'"verdict"' in text
    if is_verdict and not is_evaluator:
        return None
    try:
        said = _decoder.decode(b'{"service":%s,%s' % (json.dumps(service).encode(), text[1:]))
        if isinstance(said, GivenVerdict):
            checks = tuple(with_margin(msgspec.to_builtins(check)) for check in said.checks)
            is_good = said.outcome == "passed"
            return VerdictEvent(service, is_good, said.reason, checks, said.evidence, said.silent)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError) as error:
        problem = "its outcome is neither passed nor failed" if "$.outcome" in str(error) else str(error)
        reason = f"the verdict of evaluator '{service}' is malformed: {problem}"
        return Finding("error", reason, service) if is_verdict else None
    if isinstance(said, Late) and said.late > said.updates:
        return None
    return Noted(f"service '{service}': {said.text}") if isinstance(said, Noted) else said


def _words(event: Event) -> str:
    """What the log of a service has of what it said; empty for what comes again and again."""
    if isinstance(event, VerdictEvent):
        return f"verdict: {'passed' if event.passed else 'failed'}: {event.reason}"
    return "ready" if isinstance(event, Ready) else getattr(event, "reason", "") or getattr(event, "text", "")


@dataclass(eq=False)
class _Peer:
    """A service that has connected; its first message is its name."""

    connection: Connection
    name: str = ""
    ended: asyncio.Event = field(default_factory=asyncio.Event)


class Reports:
    """Takes what a test's services say, also into their logs; what evaluators judged goes into files next to these."""

    def __init__(
        self, plan: Plan, logs: Path, put: Callable[[Event], None], outputs: Mapping[str, ServiceOutput]
    ) -> None:
        self._services = {service.name: service for service in plan.services}
        self._logs, self._put, self._outputs = logs, put, outputs
        self._recorded = Counter[str]()
        self._listener: Listener | None = None
        self._peers: list[_Peer] = []

    def listen(self, folder: Path) -> None:
        """Listens in the folder where services meet until the application starts; raises OSError."""
        self._listener = Listener(folder / RUNNER_SOCKET, self._services)
        asyncio.get_running_loop().add_reader(self._listener.fileno(), self._accept)

    def _accept(self) -> None:
        while self._listener is not None and (connection := self._listener.connection()):
            self._peers.append(peer := _Peer(connection))
            asyncio.get_running_loop().add_reader(connection.fileno(), self._read, peer)

    def stop_listening(self) -> None:
        """Nobody else can connect: the application is about to start, or all services are there."""
        if self._listener is not None:
            asyncio.get_running_loop().remove_reader(self._listener.fileno())
            self._listener.close()
            self._listener = None

    def _read(self, peer: _Peer) -> None:
        try:
            while (message := peer.connection.receive(0.0)) is not None:
                if peer.name:
                    self.take(peer.name, message)
                else:
                    self._name(peer, message.decode("utf-8", "replace"))
        except EOFError:
            self._drop(peer)

    def _name(self, peer: _Peer, name: str) -> None:
        """Raises EOFError for an unknown service, and for one that is there already."""
        if name not in self._services or any(other.name == name and not other.ended.is_set() for other in self._peers):
            raise EOFError
        peer.name = name
        if {*self._services} <= {each.name for each in self._peers}:
            self.stop_listening()

    def _drop(self, peer: _Peer) -> None:
        asyncio.get_running_loop().remove_reader(peer.connection.fileno())
        peer.connection.close()
        peer.ended.set()

    def take_line(self, name: str, line: bytes) -> bool:
        """Takes a line that a service printed, if it is a message of one that did not connect; whether it is."""
        return all(peer.name != name for peer in self._peers) and self.take(name, line)

    def take(self, name: str, message: bytes) -> bool:
        is_evaluator = self._services[name].judge
        if is_evaluator and message.startswith(JUDGED):
            self._record(name, message)
            return True
        event = read(name, is_evaluator, message)
        if event is None:
            return False
        self._put(event)
        if (words := _words(event)) and name in self._outputs:
            self._outputs[name].add(words)
        return True

    def _record(self, name: str, line: bytes) -> None:
        self._recorded[name] += len(line)
        if self._recorded[name] > _MAX_RECORD:
            return
        file = (self._logs / f"{self._services[name].layer}.{name}.log").with_suffix(JUDGED_SUFFIX)
        try:
            with atomic.appended(file) as written:
                written.write(line.rstrip() + b"\n")
        except OSError as error:
            self._put(Noted(f"what '{name}' judged cannot be written: {error.strerror}"))

    async def ended(self, name: str) -> None:
        """Returns when a service that has ended has said all; another program may still hold its connection."""
        self._read_all()
        for peer in self._peers:
            if peer.name == name:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(peer.ended.wait(), _PATIENCE_S)

    def close(self) -> None:
        self._read_all()
        self.stop_listening()
        for peer in self._peers:
            if not peer.ended.is_set():
                self._drop(peer)

    def _read_all(self) -> None:
        self._accept()
        for peer in self._peers:
            if not peer.ended.is_set():
                self._read(peer)
