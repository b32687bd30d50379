"""A small test in lockstep, in threads: a mover, an eye that shows where it is, an evaluator, and an application."""

import os
import struct
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from services.base import Service, Verdict
from services.base.clock_link import ClockClient
from services.base.lockstep_clock import EPOCH, LockstepClock
from services.base.loop import Loop
from services.base.members import SenderTable
from services.clock.agent import TimeAgent
from services.clock.answers import AnsweringApplication, filters
from services.clock.exchange import Exchange, Roles
from services.clock.model import Stepper
from services.clock.resting import ResponseTimes, RestingApplication

STEP = 100_000
STEER, PLACE = "opendlv.proxy.GroundSteeringRequest", "opendlv.sim.Frame"
BOX = "opendlv.logic.perception.DetectionBoundingBox"


class Mover(Service):
    """Moves by the last request, 10 times a step."""

    period = STEP // 10

    def __init__(self, session: Session) -> None:
        self.inputs = {(STEER, None): self._steer}
        self._place, self._speed, self._type = 0.0, 1.0, session.messages.type(PLACE)

    def _steer(self, message: Any, _time: int) -> None:
        self._speed = message.groundSteering

    def update(self, now: int) -> Iterable[Any]:
        self._place += self._speed * 0.01
        return (self._type(x=self._place),)


def show(memory: SharedMemory, value: float, now: int) -> None:
    """As the eight bytes of a picture."""
    with memory.lock():
        memory.buffer[:8] = struct.pack("<d", value)
        memory.stamp(now)
    memory.notify_all()


class Eye(Service):
    """Shows the newest place."""

    period = STEP

    def __init__(self, memory: SharedMemory) -> None:
        self.inputs = {(PLACE, 0): self._look}
        self._memory, self._place = memory, 0.0

    def _look(self, message: Any, _time: int) -> None:
        self._place = message.x

    def update(self, now: int) -> Iterable[Any]:
        show(self._memory, self._place, now)
        return ()


class ToyEvaluator(Service):
    """Remembers the path and the boxes in pictures, and ends after some seconds or with the input."""

    period = STEP // 20

    def __init__(self, seconds: float) -> None:
        self.inputs = {
            (PLACE, 0): lambda message, time: self.path.append((time - EPOCH, message.x)),
            (BOX, None): lambda message, time: self.boxes.append(((time - EPOCH) // STEP, message.x)),
        }
        self.path: list[tuple[int, float]] = []
        self.boxes: list[tuple[int, float]] = []
        self._end = EPOCH + round(seconds * 1_000_000)

    def end_of_input(self, now: int) -> None:
        self.verdict = Verdict("passed", "all was shown")

    def update(self, now: int) -> Iterable[Any]:
        self.verdict = Verdict("passed", "enough") if now >= self._end else None
        return ()


@dataclass
class ToyApplication:
    """Steers by what it sees. ``copies`` its sample time, says it ``times`` often, ``pause`` waits before it does.

    ``boxes`` are said of each picture before that, each after another pause.
    """

    cid: int
    name: str
    copies: bool = True
    times: int = 1
    pause: Callable[[int], float] = lambda _: 0.0
    most: int = 1_000_000
    boxes: int = 0
    seen: list[float] = field(default_factory=list)

    def run(self, stopped: Callable[[], bool]) -> None:
        with Session(self.cid) as session:
            request, box = session.messages.type(STEER), session.messages.type(BOX)
            memory = SharedMemory.attach(self.name)
            try:
                while not stopped() and len(self.seen) < self.most:
                    memory.wait()  # as libcluon's readers do: one that looks away now and then may miss a picture
                    with memory.lock():
                        (place,), sampled = struct.unpack("<d", memory.buffer[:8]), memory.sample_time()
                    self.seen.append(place)
                    time.sleep(self.pause(len(self.seen)))
                    for _ in range(self.boxes):
                        session.send(box(x=place), sampled)
                        time.sleep(self.pause(len(self.seen)))
                    for n in range(self.times):
                        message = request(groundSteering=1.5 - place + n)
                        session.send(message, sampled if self.copies else None)
            except SharedMemoryError:
                return
            finally:
                memory.close()


@dataclass
class Filter:
    """An application without a camera: answers each place as soon as it hears it, and hears from the start."""

    cid: int

    def __post_init__(self) -> None:
        self._session = Session(self.cid)

    def run(self, stopped: Callable[[], bool]) -> None:
        with self._session as session:
            place, request = session.messages.id(PLACE), session.messages.type(STEER)
            while not stopped():
                envelope = session.receive(0.05)
                if envelope is not None and envelope.data_type == place:
                    message = session.messages.decode(place, envelope.payload)
                    session.send(request(groundSteering=1.5 - message.x), envelope.sample_time)


class Runs(Protocol):
    """A program, in a thread."""

    def run(self, stopped: Callable[[], bool]) -> None: ...


Memory = Callable[[], SharedMemory]
Maker = Callable[[Session, Memory], Service]
"""Makes a service of its session and what gives it its memory."""

DRIVE: dict[str, Maker] = {"mover": lambda s, _: Mover(s), "eye": lambda _, memory: Eye(memory())}


@dataclass
class Toys:
    """Runs the test: a mover goes on, others sense; the ``evaluator`` looks."""

    cid: int
    seconds: float = 2.0
    answers: tuple[str, ...] = (STEER,)
    relayed: tuple[str, ...] = ()
    timeout: int = 60_000_000
    readers: int = 1
    cast: dict[str, Maker] = field(default_factory=lambda: DRIVE)
    agent: TimeAgent | None = None
    """Where the application's own time is the test's."""

    def __post_init__(self) -> None:
        self.evaluator = ToyEvaluator(self.seconds)

    @property
    def memory_name(self) -> str:
        return f"dodo-toy-{os.getpid()}-{self.cid}"

    def application(self, **about: Any) -> ToyApplication:
        return ToyApplication(self.cid, self.memory_name, **about)

    def run(self, *applications: Runs) -> tuple[list[tuple[int, float]], Stepper]:
        """Raises what the Stepper raises."""
        stop = threading.Event()
        apps = [threading.Thread(target=each.run, args=(stop.is_set,)) for each in applications]
        started: list[threading.Thread] = []
        makers: dict[str, Maker] = {**self.cast, "judge": lambda _session, _memory: self.evaluator}
        try:
            with Session(self.cid) as session, ExitStack() as resources:
                path = Path(resources.enter_context(tempfile.TemporaryDirectory()), "clock")
                messages = session.messages

                def take(envelope: Envelope) -> None:
                    application.take(envelope)

                link = Exchange(session, path, makers, take, stop.is_set, SenderTable(messages))
                exchange = resources.enter_context(closing(link))
                application = self._under_test(messages, exchange)
                advance = tuple(name for name in self.cast if name == "mover")
                sense = tuple(name for name in self.cast if name not in advance)
                roles = Roles(advance, sense, ("judge",))
                stepper = Stepper(roles, STEP, self.timeout, application, exchange)
                with self._services(stop, makers, path):
                    for app in apps:
                        app.start()
                        started.append(app)
                    stepper.start()
                    stepper.run(Envelope(messages.id("dodo.TestBegin"), b"", 0, 0, EPOCH, 0))
        finally:
            for app in started:  # the services have removed the memory that it waits for
                app.join()
        return self.evaluator.path, stepper

    def _under_test(self, messages: MessageSet, link: Exchange) -> AnsweringApplication | RestingApplication:
        required, relayed = (filters(names, messages) for names in (self.answers, self.relayed))
        if self.agent:
            return RestingApplication(link, required, self.agent, ResponseTimes(), ("toy",))
        return AnsweringApplication(link, required, relayed)

    @contextmanager
    def _services(self, stop: threading.Event, makers: dict[str, Maker], path: Path) -> Iterator[None]:
        with ExitStack() as resources:
            loops = [self._loop(name, maker, path, resources) for name, maker in makers.items()]
            threads = [threading.Thread(target=loop.run, args=(stop.is_set,)) for loop in loops]
            for thread in threads:
                thread.start()
            try:
                yield
            finally:
                stop.set()
                for thread in threads:
                    thread.join()

    def _loop(self, name: str, maker: Maker, path: Path, resources: ExitStack) -> Loop:
        session = resources.enter_context(Session(self.cid))
        client = ClockClient(session, name, path)
        clock = LockstepClock(session, name, self.readers, client)
        service = maker(session, lambda: resources.enter_context(clock.memory(self.memory_name, 8)))
        return Loop(name, service, session, clock, 0)
