"""Commands of the clock to the services of a test over their channels, and how a test can end."""

import select
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.opendlv.address import LINES, Address
from dodo_dsl.opendlv.address_book import RUNNER
from dodo_dsl.opendlv.channel import Channel, Done, Show, Step
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.packets import Listener
from dodo_dsl.opendlv.session import Session
from services.base.members import SenderTable


class Exchange:
    """Commands the ``services``; messages of others on the bus go to ``take``, if ``senders`` let them send those."""

    def __init__(
        self,
        session: Session,
        path: Path,
        services: Iterable[str],
        take: Callable[[Envelope], None],
        senders: SenderTable | None = None,
    ) -> None:
        """Raises OSError."""
        self._session, self._take_other = session, take
        self._senders = senders or SenderTable(session.messages)
        self._listener = Listener(path, services)
        self._channels: dict[str, Channel] = {}
        self._unsent: dict[str, Step | Show] = {}
        self._expected: dict[str, int] = {}
        """How many results of each service are to come, of which the last counts."""
        self._own: set[Address] = set()

    def send(self, service: str, command: Step | Show) -> None:
        self._expected[service] = self._expected.get(service, 0) + 1
        if service in self._channels:
            self._channels[service].send(command)
        else:
            self._unsent[service] = command

    def result(self, service: str, timeout: float = 0.0) -> Done | None:
        """A service's answer to its last command within ``timeout`` seconds, once."""
        if self._listener.missing:
            self._accept(0.0 if service in self._channels else timeout)
        if service not in self._channels:
            time.sleep(0.0 if self._listener.missing else timeout)
            return None
        try:
            done = self._channels[service].receive(timeout)
        except EOFError:  # the runner says why it has ended
            del self._channels[service]
            return None
        if not isinstance(done, Done):
            return None
        self._expected[service] -= 1
        if done.about is not None:
            self._own.add(done.about.address)
        return done if not self._expected[service] else self.result(service, timeout)

    def _accept(self, timeout: float) -> None:
        if accepted := self._listener.accept(timeout):
            name, channel = accepted[0], Channel(accepted[1])
            self._channels[name] = channel
            if name in self._unsent:
                channel.send(self._unsent.pop(name))

    def pump(self, timeout: float, services: Collection[str] = ()) -> None:
        """Take the next message of the bus, unless one of the ``services`` answers before, within ``timeout`` s."""
        if not self._take_from_bus():
            channels = [self._channels[name].fileno() for name in services if name in self._channels]
            select.select([*self._session.filenos(), *channels], [], [], max(0.0, min(timeout, SLICE_S)))

    def drain(self) -> None:
        while self._take_from_bus():
            pass

    def _take_from_bus(self) -> bool:
        envelope = self._session.receive(0.0)
        if envelope is None:
            return False
        if not self._session.was_direct or self._session.source == self._runner():
            self.hear(envelope, self._session.source)
        return True

    def hear(self, envelope: Envelope, source: Address) -> None:
        """Take a message from the bus; the addresses of all services are known."""
        if source not in self._own and self._senders.is_of_runner(envelope, source):
            producers = self._senders.producers(envelope)
            if producers is None or (LINES in producers.services and source == self._runner()):
                self._take_other(envelope)
            else:
                self._senders.report(producers.reason)

    def _runner(self) -> Address | None:
        self._senders.book.read()
        return self._senders.book.addresses.get(RUNNER)

    def close(self) -> None:
        self._listener.close()
        for channel in self._channels.values():
            channel.close()


SLICE_S = 0.05
"""How often the clock checks whether it has to stop."""


class TestEnded(Exception):
    """The test cannot go on. ``kind`` names the reason; ``silent``: nothing came of the application."""

    kind = ""

    def __init__(self, reason: str = "", *, silent: bool = False) -> None:
        super().__init__(reason)
        self.silent = silent


class ApplicationSilent(TestEnded):
    kind = "unanswered"


class ApplicationFloods(TestEnded):
    kind = "unanswered"


class ServiceSilent(TestEnded):
    kind = "stuck"


class TimeOver(TestEnded):
    kind = "timedout"


IsStopped = Callable[[], bool]


@dataclass(frozen=True)
class Roles:
    """The services of a test: ``advance`` and ``sense`` step in order, ``judge`` and ``watch`` alongside."""

    advance: tuple[str, ...]
    sense: tuple[str, ...]
    judge: tuple[str, ...]
    watch: tuple[str, ...] = ()

    @property
    def all(self) -> tuple[str, ...]:
        return (*self.advance, *self.sense, *self.judge, *self.watch)


class Patience(NamedTuple):
    """Processor time in s that the application may compute without a wait, at its start and later."""

    first: float = 30.0
    others: float = 2.0


PATIENCE = Patience()

WALL_FACTOR = 10.0
"""How many times its patience it may take of wall time: others may have the processor."""
