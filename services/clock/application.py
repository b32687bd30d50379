"""The application under test as the clock sees it: it is shown pictures, and answers."""

import time
from collections.abc import Iterable, Sequence

from dodo_dsl.opendlv.bus.envelope import Envelope
from services.base.lockstep.datagrams import Said
from services.clock.answers import Answers
from services.clock.exchange import Done, Order
from services.clock.participants import SLICE_S, Patience, Stopped, Talk, Unanswered

_AGAIN_S = 0.5


class Audience:
    """Shows it pictures and waits for its answers; ``frames`` counts what it was shown."""

    def __init__(self, answers: Answers, patience: Patience, talk: Talk, stopped: Stopped) -> None:
        self.answers = answers
        self.frames = 0
        self.waited_first, self.waited = 0.0, 0.0
        """Wall time in s for the first answer, and for all others."""
        self._patience, self._talk, self._stopped = patience, talk, stopped
        self._began = 0.0
        self._first: list[Said] = []
        self._reading: set[str] = set()
        """Cameras whose readers do not wait for the next picture yet, where nothing else tells of an answer."""

    def listens(self, now: int) -> None:
        """One that sees no pictures answers what the services are about to say in the step of this time (us)."""
        self._talk.drain()
        self.answers.expect([now])
        self.answers.seen()

    def missed(self, said: Iterable[Said]) -> None:
        """The services have said this; until the first picture is shown it may be too early."""
        if not self.frames:
            self._first.extend(said)

    def show(self, shown: Sequence[Done], now: int) -> None:
        """Readers are told of new pictures as soon as they wait for them; raises Unanswered."""
        self.frames += 1
        self._began = time.monotonic()
        again = self._began + _AGAIN_S
        if shown:
            self.answers.expect(camera.sampled for camera in shown)
        for camera in shown:
            self._talk.ask([Order(camera.service, now, (), show=True)])
            while self._talk.answer(camera.service) is None:
                if self._stopped():
                    return
                if self._left <= 0:
                    self._talk.forget()
                    raise Unanswered(self._sentence(f"nobody waited for a picture of '{camera.service}'"))
                self._talk.pump(SLICE_S)
                again = self._say_again(again)
            self.answers.seen()
        if not self.answers.asked:
            self._reading = {camera.service for camera in shown}
            self._talk.ask([Order(camera.service, now, (), show=True) for camera in shown])

    def await_answer(self) -> None:
        """To what was shown; raises Unanswered."""
        while not (self._stopped() or self._is_answered):
            if self._left <= 0:
                raise Unanswered(self._sentence(self._missing))
            self._talk.pump(self._left)
        spent = time.monotonic() - self._began
        if self.frames == 1:
            self.waited_first += spent
        else:
            self.waited += spent

    def collect(self) -> list[Envelope]:
        """What it said since the last time, for the services."""
        return self.answers.collect()

    @property
    def _limit(self) -> float:
        return self._patience.first if self.frames == 1 else self._patience.others

    @property
    def _left(self) -> float:
        return self._began + self._limit - time.monotonic()

    def _say_again(self, again: float) -> float:
        """One that starts late hears what was said before its first picture, as it would in real time."""
        if self.frames > 1 or time.monotonic() < again:
            return again
        self._talk.tell(self._first)
        return time.monotonic() + _AGAIN_S

    @property
    def _is_answered(self) -> bool:
        """Whether all answers came; where none are known, whether the readers wait for the next picture."""
        if self.answers.asked:
            return self.answers.complete
        self._reading = {name for name in self._reading if self._talk.answer(name) is None}
        return not self._reading

    @property
    def _missing(self) -> str:
        if self.answers.asked:
            return " and ".join(name.rpartition(".")[2] for name in self.answers.missing) + " missing"
        return f"nobody waited for the next picture of '{min(self._reading)}'"

    def _sentence(self, what: str) -> str:
        return f"the application did not answer frame {self.frames} within {self._limit:g} s ({what})"
