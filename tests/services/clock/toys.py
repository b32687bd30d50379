"""A small test in lockstep, in threads: a mover, an eye that shows where it is, a judge, and an application."""

import os
import struct
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.memory import SharedMemory, SharedMemoryError
from dodo_dsl.opendlv.session import Session
from services.base import Service, Verdict
from services.base.channel import Channel
from services.base.lockstep import EPOCH, LockstepClock
from services.base.loop import Loop
from services.clock.answers import Answers, kinds
from services.clock.exchange import Exchange
from services.clock.model import Patience, Roles, Stepper

STEP = 100_000
STEER, PLACE = "opendlv.proxy.GroundSteeringRequest", "opendlv.sim.Frame"


class Mover(Service):
    """Moves by what it was told last, 10 times a step."""

    period = STEP // 10

    def __init__(self, session: Session) -> None:
        self.inputs = {(STEER, None): self._steer}
        self._place, self._speed, self._type = 0.0, 1.0, session.messages.type(PLACE)

    def _steer(self, message: Any, _time: int) -> None:
        self._speed = message.groundSteering

    def update(self, now: int) -> Iterable[Any]:
        self._place += self._speed * 0.01
        return (self._type(x=self._place),)


class Eye(Service):
    """Shows the newest place as the eight bytes of a picture."""

    period = STEP

    def __init__(self, memory: SharedMemory) -> None:
        self.inputs = {(PLACE, 0): self._look}
        self._memory, self._place = memory, 0.0

    def _look(self, message: Any, _time: int) -> None:
        self._place = message.x

    def update(self, now: int) -> Iterable[Any]:
        with self._memory.lock():
            self._memory.buffer[:8] = struct.pack("<d", self._place)
            self._memory.stamp(now)
        self._memory.notify_all()
        return ()


class Judge(Service):
    """Remembers the way, and has seen enough after some seconds."""

    period = STEP // 20

    def __init__(self, seconds: float) -> None:
        self.inputs = {(PLACE, 0): lambda message, time: self.way.append((time - EPOCH, message.x))}
        self.way: list[tuple[int, float]] = []
        self._end = EPOCH + round(seconds * 1_000_000)

    def update(self, now: int) -> Iterable[Any]:
        self.verdict = Verdict("passed", "enough") if now >= self._end else None
        return ()


@dataclass
class Application:
    """Steers by what it sees. ``copies`` its sample time, says it ``times`` often, ``pause`` waits before it does."""

    cid: int
    name: str
    copies: bool = True
    times: int = 1
    pause: Callable[[int], float] = lambda _: 0.0
    most: int = 1_000_000
    seen: list[float] = field(default_factory=list)

    def run(self, stopped: Callable[[], bool]) -> None:
        with Session(self.cid) as session:
            request = session.messages.type(STEER)
            memory = SharedMemory.attach(self.name)
            try:
                while not stopped() and len(self.seen) < self.most:
                    if not memory.wait(0.05):
                        continue
                    with memory.lock():
                        (place,), sampled = struct.unpack("<d", memory.buffer[:8]), memory.sample_time()
                    self.seen.append(place)
                    time.sleep(self.pause(len(self.seen)))
                    for n in range(self.times):
                        message = request(groundSteering=1.5 - place + n)
                        session.send(message, sampled if self.copies else None)
            except SharedMemoryError:
                return
            finally:
                memory.close()


@dataclass
class Toys:
    """Runs the test; ``way`` is what the judge saw."""

    cid: int
    seconds: float = 2.0
    patience: Patience = field(default_factory=lambda: Patience(5.0, 2.0))
    answers: tuple[str, ...] = (STEER,)

    @property
    def memory_name(self) -> str:
        return f"dodo-toy-{os.getpid()}-{self.cid}"

    def application(self, **about: Any) -> Application:
        return Application(self.cid, self.memory_name, **about)

    def run(self, application: Application) -> tuple[list[tuple[int, float]], Stepper]:
        """Raises what the Stepper raises."""
        judge = Judge(self.seconds)
        stop = threading.Event()
        with self._services(judge, stop), Session(self.cid) as session:
            app = threading.Thread(target=application.run, args=(stop.is_set,))
            app.start()
            channel = Channel(self.cid, session.messages)
            ids = {name: session.messages.id(name) for name in session.messages.names()}
            answers = Answers(kinds(self.answers, ids))
            exchange = Exchange(session, channel, answers.take)
            roles = Roles(("mover",), ("eye",), ("judge",))
            stepper = Stepper(roles, STEP, 60_000_000, self.patience, answers, exchange, stop.is_set)
            try:
                stepper.meet()
                stepper.run(Envelope(ids["dodo.TestBegin"], b"", 0, 0, EPOCH, 0))
            finally:
                stop.set()
                app.join()
                channel.close()
        return judge.way, stepper

    @contextmanager
    def _services(self, judge: Judge, stop: threading.Event) -> Iterator[None]:
        sessions = [Session(self.cid) for _ in range(3)]
        clocks = [LockstepClock(s, name, 1) for s, name in zip(sessions, ("mover", "eye", "judge"), strict=True)]
        with ExitStack() as resources:
            for session in sessions:
                resources.enter_context(session)
            memory = resources.enter_context(clocks[1].memory(self.memory_name, 8))
            services: list[Service] = [Mover(sessions[0]), Eye(memory), judge]
            parts = zip(services, sessions, clocks, strict=True)
            loops = [Loop("toy", service, session, clock, 0) for service, session, clock in parts]
            threads = [threading.Thread(target=loop.run, args=(stop.is_set,)) for loop in loops]
            for thread in threads:
                thread.start()
            try:
                yield
            finally:
                stop.set()
                for thread in threads:
                    thread.join()
