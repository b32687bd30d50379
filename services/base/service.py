"""Everything of a service that is not its model: bus, clock, signals, readiness, end of input, verdict."""

import logging
import os
import signal
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.codec import MessageError
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.memory import SharedMemory
from dodo_dsl.opendlv.messages import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import flags as flags_module
from services.base.clock import MICROSECONDS, Clock, RealTimeClock
from services.base.flags import Flags, FlagsError
from services.base.verdict import Verdict

IDLE_PERIOD = 50_000
READY = '{"dodo": "ready"}'

Handler = Callable[[Any, int], None]
"""Takes a message and its sample time in microseconds."""


class Output(NamedTuple):
    """A message to send with a sender stamp of its own."""

    message: Message
    sender_stamp: int


class Service:
    """A model as the loop sees it; models override what they need.

    ``period`` is in microseconds of test time. ``inputs`` maps a message's name, and the sender stamp that counts
    (None for any), to what takes it. Nothing in a model reads a clock, sleeps or touches the bus.
    """

    period: int = IDLE_PERIOD
    inputs: Mapping[tuple[str, int | None], Handler] = {}
    observe: Callable[[Envelope], None] | None = None
    verdict: Verdict | None = None
    finished: bool = False

    def begin(self, now: int) -> None:
        """All services are ready: the test begins."""

    def update(self, now: int) -> Iterable[Message | Output]:
        """What there is to say at ``now``; it is sent with ``now`` as its sample time."""
        return ()

    def end_of_input(self, now: int) -> None:
        """A source has run out: evaluators decide with what they have."""


@dataclass
class Context:
    """What a service is built from; shared memory made here is removed at the end."""

    name: str
    flags: Flags
    messages: MessageSet
    resources: ExitStack = field(default_factory=ExitStack)

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory of ``size`` bytes; raises SharedMemoryError."""
        return self.resources.enter_context(SharedMemory.create(name, size))


Build = Callable[[Context], Service]


def period_of(freq: float) -> int:
    """The period in microseconds of a rate in Hz."""
    return max(1, round(MICROSECONDS / freq))


def run(folder: Path, build: Build, argv: Sequence[str] | None = None, clock: Clock | None = None) -> int:
    """A service from its command line to its exit code: 0 done or told to stop, 1 broken, 2 wrong flags."""
    words = sys.argv[1:] if argv is None else argv
    manifest = flags_module.load_manifest(folder)
    if "--help" in words:
        sys.stdout.write(flags_module.help_text(manifest))
        return 0
    name = manifest["name"]
    try:
        flags = flags_module.parse(manifest, words)
    except FlagsError as error:
        sys.stderr.write(f"{name}: {error}\n")
        return 2
    level = logging.DEBUG if flags["verbose"] else logging.INFO
    logging.basicConfig(stream=sys.stderr, level=level, format=f"{name}: %(levelname)s: %(message)s")
    stop = _Stop()
    with ExitStack() as resources:
        try:
            session = resources.enter_context(Session(flags["cid"]))
            service = build(Context(name, flags, session.messages, resources))
        except (ValueError, OSError) as error:
            logging.critical("%s", error)
            return 2
        resources.enter_context(_ready(name))
        loop = _Loop(service, session, clock or RealTimeClock(), stop, flags["id"])
        try:
            loop.run()
        except Exception as error:
            logging.critical("%s: %s", type(error).__name__, error, exc_info=bool(flags["verbose"]))
            return 1
    return 0


class _Stop:
    """Set by SIGTERM and SIGINT."""

    def __init__(self) -> None:
        self.asked = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._ask)

    def _ask(self, _number: int, _frame: object) -> None:
        self.asked = True


class _ready:  # noqa: N801  (a context manager that reads as a word)
    """Says that the service is ready, and leaves the ready file as long as it is."""

    def __init__(self, name: str) -> None:
        service = os.environ.get("DODO_SERVICE", name)
        self.file = Path(os.environ.get("DODO_READY_FILE", f"/tmp/dodo-ready-{service}"))

    def __enter__(self) -> None:
        self.file.touch()
        print(READY, flush=True)

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self.file.unlink()


class _Loop:
    """Delivers messages and steps until a verdict, the end of a source, or a signal."""

    def __init__(self, service: Service, session: Session, clock: Clock, stop: _Stop, sender_stamp: int) -> None:
        self.service = service
        self.session = session
        self.clock = clock
        self.stop = stop
        self.sender_stamp = sender_stamp
        messages = session.messages
        self.handlers: dict[int, list[tuple[int | None, Handler]]] = {}
        for (name, stamp), handler in service.inputs.items():
            self.handlers.setdefault(messages.id(name), []).append((stamp, handler))
        self.begin = messages.id("dodo.TestBegin")
        self.end = messages.id("dodo.EndOfInput")

    def run(self) -> None:
        for now in self.clock.steps(self.service.period, self._deliver, self._over):
            for output in self.service.update(now):
                self._send(output, now)
            if self.service.finished:
                break
        if self.service.verdict is not None:
            print(self.service.verdict.line(), flush=True)
        elif self.service.finished:
            source = os.environ.get("DODO_SERVICE", "")
            self._send(self.session.messages.type("dodo.EndOfInput")(source=source), self.clock.now())

    def _over(self) -> bool:
        return self.stop.asked or self.service.verdict is not None

    def _send(self, output: Message | Output, now: int) -> None:
        message, stamp = output if isinstance(output, Output) else (output, self.sender_stamp)
        self.session.send(message, now, stamp)

    def _deliver(self, timeout: float) -> bool:
        envelope = self.session.receive(timeout)
        if envelope is None:
            return False
        if self.service.observe is not None:
            self.service.observe(envelope)
        if envelope.data_type == self.begin:
            self.service.begin(envelope.sample_time)
        elif envelope.data_type == self.end:
            self.service.end_of_input(self.clock.now())
        else:
            self._handle(envelope)
        return True

    def _handle(self, envelope: Envelope) -> None:
        handlers = self.handlers.get(envelope.data_type)
        if handlers is None:
            return
        try:
            message = self.session.messages.decode(envelope.data_type, envelope.payload)
        except MessageError as error:
            logging.warning("message %d of sender %d: %s", envelope.data_type, envelope.sender_stamp, error)
            return
        for stamp, handler in handlers:
            if stamp is None or stamp == envelope.sender_stamp:
                handler(message, envelope.sample_time)
