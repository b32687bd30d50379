"""The application that keeps the machine's time: it is awaited by its answers to each frame, or step."""

import time
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.opendlv.channel import Done, Show
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.clock import exchange
from services.clock.exchange import ApplicationFails, ApplicationFloods, Exchange

MOST_SURPLUS = 100
"""Surplus messages of one kind to a frame; more of them are a flood that would keep others from the bus."""


@dataclass(frozen=True)
class MessageFilter:
    """A message by its id and sender stamp; None is any stamp. ``name`` is what the application declares."""

    name: str
    data_type: int
    sender_stamp: int | None = None

    def matches(self, envelope: Envelope) -> bool:
        same = envelope.data_type == self.data_type
        return same and self.sender_stamp in (None, envelope.sender_stamp)


def filters(names: Iterable[str], messages: MessageSet) -> tuple[MessageFilter, ...]:
    """Messages written as ``name`` or ``name/senderStamp``; raises MessageError for one that is unknown."""
    return tuple(MessageFilter(text, *messages.key(text)) for text in names)


@dataclass
class AnsweringApplication:
    """Shows pictures to the application and waits for its answers; ``frames`` counts what was shown.

    ``required`` have to come once each, unless ``done`` comes; ``relayed`` are others that services of the test
    consume, all of which are passed on; so are those under other sender stamps, which services only count. Further
    answers to a frame are dropped.
    """

    link: Exchange
    required: tuple[MessageFilter, ...]
    relayed: tuple[MessageFilter, ...] = ()
    done: MessageFilter | None = None
    frames: int = 0
    _times: set[int] = field(default_factory=set)
    _all_times: set[int] = field(default_factory=set)
    _chosen: dict[MessageFilter, Envelope] = field(default_factory=dict)
    _others: list[Envelope] = field(default_factory=list)
    _surplus: Counter[str] = field(default_factory=Counter)
    _is_silent: bool = True
    _is_seen: bool = False
    _is_done: bool = False
    _is_collected: bool = False
    _is_shown: bool = False
    _has_cameras: bool = False
    _began: float = 0.0
    _reading: set[str] = field(default_factory=set)
    """Cameras whose readers do not wait for the next picture yet, where no message completes a frame."""

    @property
    def filters(self) -> tuple[MessageFilter, ...]:
        return (*self.required, *self.relayed, *([self.done] if self.done else []))

    def facts(self) -> dict[str, Any]:
        """Nothing is measured: what it waits for a processor is not known."""
        return {}

    def start(self, now: int, cameras: Collection[str]) -> None:
        """It may still be starting: the first picture waits for it."""
        self._has_cameras = bool(cameras)

    def begin_step(self, now: int) -> None:
        """Without cameras, it answers what services are about to send in the step of this time (us)."""
        if not self._has_cameras:
            self.link.drain()
            self.expect([now])
            self.seen()

    def show(self, shown: Sequence[Done], now: int) -> None:
        """Announce new pictures as soon as readers wait for them; raises TestEnded."""
        self._is_shown = bool(shown) or not self._has_cameras
        self.frames += self._is_shown
        self._began = time.monotonic()
        if shown:
            self.expect(camera.sampled for camera in shown)
        for camera in shown:
            if not camera.awaited:
                self._go(camera.service, Show(awaits=True, announces=False))
            self.link.drain()  # what the application has sent before it can see the picture
            self.seen()
            self._go(camera.service, Show(awaits=False, announces=True))
        if not (self.required or self.done):
            self._reading = {camera.service for camera in shown}
            for name in self._reading:
                self.link.send(name, Show(awaits=True, announces=False))

    def _go(self, camera: str, command: Show) -> None:
        self.link.send(camera, command)
        while self.link.result(camera) is None and not self.link.stopped():
            self._pump([camera], f"no reader waited for a picture of '{camera}'")

    def expect(self, times: Iterable[int]) -> None:
        """A frame will be shown, with these sample times (us): answers that copy one of them count at once."""
        self._times = set(times)
        self._all_times |= self._times
        self._chosen, self._is_seen, self._is_done, self._is_collected = {}, False, False, False
        self._surplus.clear()

    def seen(self) -> None:
        self._is_seen = True

    def take(self, envelope: Envelope) -> None:
        """Take a message from the bus.

        An answer counts by the frame's sample time. Where the application does not copy sample times, the first message
        after the frame counts, and gets the frame's sample time. Raises ApplicationFails.
        """
        if not self._times:
            return
        copies = envelope.sample_time in self._all_times
        stale = envelope.sample_time not in self._times if copies else not self._is_seen
        known = envelope if copies else envelope._replace(sample_time=max(self._times))
        if self.done is not None and self.done.matches(envelope) and not stale:
            self._is_done = True
        is_own = any(each.matches(envelope) for each in self.filters)
        self._is_silent &= not is_own
        for each in self.required:
            if each.matches(envelope):
                if stale or each in self._chosen or self._is_collected:
                    self._refuse_flood(each)
                else:
                    self._chosen[each] = known
                return
        consumed = (*self.required, *self.relayed)
        if any(each.matches(envelope) if is_own else each.data_type == envelope.data_type for each in consumed):
            self._others.append(known)

    def _refuse_flood(self, each: MessageFilter) -> None:
        self._surplus[each.name] += 1
        if self._surplus[each.name] > MOST_SURPLUS:
            message = each.name.rpartition(".")[2]
            sent = f"sent more than {MOST_SURPLUS} {message}s that nobody asked for"
            raise ApplicationFloods(f"the application {sent} within a frame: it floods the bus")

    def await_answer(self, until: int) -> None:
        """Wait for the answer to what was shown; raises TestEnded."""
        while self._is_shown and not self.link.stopped() and (what := self.missing()):
            self._pump(self._reading, what, silent=self._is_silent)

    def missing(self) -> str:
        """What of the answer is; where no message is one, it is there when readers wait for the next picture."""
        if self.required or self.done:
            missing = [each.name for each in self.required if each not in self._chosen]
            if self.done is not None:
                missing = [] if self._is_done else [self.done.name]
            return " and ".join(name.rpartition(".")[2] for name in missing) + " missing" * bool(missing)
        self._reading = {name for name in self._reading if self.link.result(name) is None}
        return f"no reader waited for the next picture of '{min(self._reading)}'" if self._reading else ""

    def _pump(self, cameras: Collection[str], what: str, *, silent: bool = False) -> None:
        """Take a message of the bus or an answer of a camera; ``what`` is missing when the time is over."""
        limit = exchange.FIRST_PATIENCE if self.frames == 1 else exchange.WALL_FACTOR * exchange.PATIENCE
        left = self._began + limit - time.monotonic()
        if left <= 0:
            raise ApplicationFails(
                f"the application did not answer frame {self.frames} within {limit:g} s ({what})", silent=silent
            )
        self.link.pump(left, cameras)

    def collect(self) -> list[Envelope]:
        """The answer, in an order that does not depend on which sender was faster."""
        others, self._others = self._others, []
        others.sort(key=lambda e: (e.sample_time, e.data_type, e.sender_stamp))
        was_collected, self._is_collected = self._is_collected, True
        chosen = [] if was_collected else [self._chosen[each] for each in self.required if each in self._chosen]
        return [*others, *chosen]
