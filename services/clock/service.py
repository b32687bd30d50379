"""The clock on the bus: steps that are repeated until they are answered, and what the runner is told."""

import json
import time
from collections.abc import Callable, Sequence
from typing import Any

from dodo_dsl.opendlv.envelope import Envelope, FrameError
from dodo_dsl.opendlv.session import Session
from services.base.lockstep import EPOCH
from services.base.parts import STEP, STEP_DONE, Pieces, cut, frames
from services.base.service import Service
from services.clock.answers import Answers
from services.clock.model import Done, Patience, Roles, Stepper, TimedOut, Unanswered

REPEAT_S = 0.2
_TELL_S = 1.0
_SLICE = 0.05


class ClockService(Service):
    """Drives a test by its Stepper."""

    def __init__(
        self,
        session: Session,
        roles: Roles,
        answers: Answers,
        period: int,
        timeout: int,
        patience: Patience,
        wall_timeout: float,
    ) -> None:
        self._session, self._answers = session, answers
        self._step = session.messages.type(STEP)
        self._done_id, self._begin_id = session.messages.id(STEP_DONE), session.messages.id("dodo.TestBegin")
        self._stepper = Stepper(roles, period, timeout, patience, answers, self._exchange, self._wait)
        self._wall_timeout = wall_timeout
        self._number = 0
        self._dones: dict[tuple[int, str], Done] = {}
        self._pieces: dict[str, Pieces] = {}
        self._told = 0.0
        self._stopped: Callable[[], bool] = lambda: False
        self._deadline = float("inf")
        self.drive = self._drive

    def _drive(self, stopped: Callable[[], bool]) -> None:
        self._stopped = stopped
        begin = self._await_begin()
        if begin is None:
            return
        self._deadline = time.monotonic() + self._wall_timeout
        try:
            self._stepper.run(begin._replace(sample_time=EPOCH), self._over)
        except Unanswered as unanswered:
            self._say("unanswered", reason=str(unanswered))
        except TimedOut:
            self._say("timeout", reason="")
        self._tell_time(last=True)

    def _over(self) -> bool:
        if time.monotonic() > self._deadline:
            self._say("timeout", reason=f"the test took more than {self._wall_timeout:g} s of wall time")
            self._deadline = float("inf")
            return True
        return self._stopped()

    def _await_begin(self) -> Envelope | None:
        while not self._stopped():
            envelope = self._session.receive(_SLICE)
            if envelope is not None and envelope.data_type == self._begin_id:
                return envelope
        return None

    def _exchange(self, orders: Sequence[tuple[str, int, list[Envelope]]]) -> list[Done]:
        """Sends the steps again until each is answered; a service that has died ends the test from outside."""
        messages: dict[tuple[int, str], list[Any]] = {}
        for name, until, heard in orders:
            self._number += 1
            pieces = cut(heard)
            messages[(self._number, name)] = [
                self._step(number=self._number, services=name, time=until, part=part, parts=len(pieces), frames=data)
                for part, data in enumerate(pieces)
            ]
        repeat = 0.0
        while missing := [key for key in messages if key not in self._dones]:
            if self._over():
                return []
            if time.monotonic() >= repeat:
                for key in missing:
                    for message in messages[key]:
                        self._session.send(message)
                repeat = time.monotonic() + REPEAT_S
            self._wait(max(0.0, repeat - time.monotonic()))
        self._tell_time()
        return [self._dones.pop(key) for key in messages]

    def _wait(self, timeout: float) -> None:
        """Take what comes next on the bus."""
        envelope = self._session.receive(min(timeout, _SLICE))
        if envelope is None:
            return
        if envelope.data_type == self._done_id:
            self._take_done(envelope)
        else:
            self._answers.take(envelope)

    def _take_done(self, envelope: Envelope) -> None:
        try:
            done: Any = self._session.messages.decode(envelope.data_type, envelope.payload)
            pieces = self._pieces.setdefault(done.service, Pieces())
            data = pieces.take(done.number, done.part, done.parts, done.frames)
            if data is not None:
                sent = tuple(frames(data))
                self._dones[(done.number, done.service)] = Done(
                    done.service, sent, done.pictures, done.ended, done.next
                )
        except (FrameError, ValueError):
            return  # not from one of ours

    def _tell_time(self, last: bool = False) -> None:
        if last or time.monotonic() - self._told > _TELL_S:
            self._told = time.monotonic()
            self._say("time", s=(self._stepper.now - EPOCH) / 1e6, surplus=self._answers.surplus)

    @staticmethod
    def _say(kind: str, **facts: object) -> None:
        print(json.dumps({"dodo": kind, **facts}), flush=True)
