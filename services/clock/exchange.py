"""Commands of the clock to the services of a test over their channels, and how a test can end."""

import select
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.opendlv.address import LINES, Address
from dodo_dsl.opendlv.address_book import RUNNER
from dodo_dsl.opendlv.channel import Channel, Done, Show, Step
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.packets import Listener
from dodo_dsl.opendlv.session import Session
from services.base.members import SenderTable

SLICE_S = 0.05
"""How often the clock checks whether it has to stop."""
START_PATIENCE = 240.0
"""Wall time in s for all services to connect, as the clock begins while others still start: layer after layer."""
SERVICE_PATIENCE = 60.0
"""Wall time in s that services of the test have for a step; none takes nearly as long."""
FIRST_PATIENCE, PATIENCE = 30.0, 2.0
"""Processor time in s that the application may compute without a wait, at its start and later."""
WALL_FACTOR = 10.0
"""How many times its patience it may take of wall time: others may have the processor."""


class TestEnded(Exception):
    """The test cannot go on. ``kind`` names the reason; ``silent``: nothing came of the application."""

    kind = ""

    def __init__(self, reason: str = "", *, silent: bool = False) -> None:
        super().__init__(reason)
        self.silent = silent


class ApplicationFails(TestEnded):
    kind = "unanswered"


class ApplicationFloods(ApplicationFails):
    """It counts also where the test is over."""


class ServiceSilent(TestEnded):
    kind = "stuck"


class TimeOver(TestEnded):
    kind = "timedout"


class Exchange:
    """Commands the ``services``; messages of others on the bus go to ``take``, if ``senders`` let them send those."""

    def __init__(
        self,
        session: Session,
        path: Path,
        services: Iterable[str],
        take: Callable[[Envelope], None],
        stopped: Callable[[], bool],
        senders: SenderTable,
    ) -> None:
        """``stopped`` says whether the test is over, and nothing is to be awaited any more. Raises OSError."""
        self.stopped = stopped
        self._session, self._take_other = session, take
        self._senders = senders
        self._listener = Listener(path, services)
        self._channels: dict[str, Channel] = {}
        self._own: set[Address] = set()

    def connect(self) -> None:
        """Wait until all services are there; raises ServiceSilent."""
        end = time.monotonic() + START_PATIENCE
        while self._listener.missing and not self.stopped():
            if accepted := self._listener.accept(SLICE_S):
                self._channels[accepted[0]] = Channel(accepted[1])
            elif time.monotonic() > end:
                missing = min(self._listener.missing)
                raise ServiceSilent(f"service '{missing}' did not connect to the clock within {START_PATIENCE:g} s")

    def send(self, service: str, command: Step | Show) -> None:
        """Command a service, which answers once."""
        if service in self._channels:
            self._channels[service].send(command)

    def results(self, services: Iterable[str], patience: float = SERVICE_PATIENCE) -> list[Done]:
        """The answers of services, fewer where the test is over; raises ServiceSilent."""
        found: list[Done] = []
        end = time.monotonic() + patience
        for name in services:
            while (done := self.result(name, SLICE_S)) is None:
                if self.stopped():
                    return found
                if time.monotonic() > end:
                    raise ServiceSilent(f"service '{name}' did not answer the clock within {patience:g} s")
            found.append(done)
        return found

    def result(self, service: str, timeout: float = 0.0) -> Done | None:
        """A service's answer within ``timeout`` seconds."""
        if service not in self._channels:
            time.sleep(timeout)
            return None
        try:
            done = self._channels[service].receive(timeout)
        except EOFError:  # the runner says why it has ended
            del self._channels[service]
            return None
        assert done is None or isinstance(done, Done), "services answer"
        if done is not None and done.about is not None:
            self._own.add(done.about.address)
        return done

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
        if envelope is not None:
            self.hear(envelope, self._session.source)
        return envelope is not None

    def hear(self, envelope: Envelope, source: Address) -> None:
        """Take a message from the bus; the addresses of all services are known."""
        if source in self._own or not self._senders.is_of_runner(envelope, source):
            return
        is_runner, producers = source == self._senders.address(RUNNER), self._senders.producers(envelope)
        if self._session.was_direct and not is_runner:
            return
        if producers is None or (LINES in producers.services and is_runner):
            self._take_other(envelope)
        else:
            self._senders.report(producers.reason)

    def close(self) -> None:
        self._listener.close()
        for channel in self._channels.values():
            channel.close()


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
