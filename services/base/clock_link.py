"""A service's link to the clock of a test in lockstep, beside the bus, which only a service that observes it hears."""

import select
import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path

from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.address_book import HEARTBEAT, RUNNER, AddressBook
from dodo_dsl.opendlv.channel import Channel, Done, Show, Step
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.packets import CLOCK_SOCKET
from dodo_dsl.opendlv.session import Session
from services.base.members import channel

SLICE_S = 0.1
_MOST = 10_000
"""Messages that an observer takes before it looks at the clock again."""
_MEANWHILE = 0.003
"""Seconds that an observer of the bus waits after a message, so that it wakes once for several."""


def socket_path() -> Path:
    """Where the clock listens; raises ValueError where the environment names no folder."""
    if (folder := channel()) is None:
        raise ValueError(f"{CHANNEL_VARIABLE} names no folder where services meet the clock")
    return folder / CLOCK_SOCKET


class ClockClient:
    """Receives commands and answers them. It waits for the clock."""

    def __init__(self, session: Session, name: str, path: Path | None = None) -> None:
        self._session = session
        self._channel = Channel.connect(path or socket_path(), name)
        self._begin = session.messages.id("dodo.TestBegin")
        self._book = AddressBook(channel())

    def next(self, observe: Callable[[Envelope], None] | None) -> Step | Show | None:
        """The next command, or None after a while; ``observe`` takes what others than services sent before it."""
        if observe is None:
            self._session.deafen()
            return self._receive(SLICE_S)
        command = self._receive(0.0)
        has_heard = self.drain(observe)
        if command is None:
            heard = [] if has_heard else [self._session.fileno()]
            select.select([self._channel.fileno(), *heard], [], [], _MEANWHILE if has_heard else SLICE_S)
        return command

    def answer(self, done: Done) -> None:
        self._channel.send(done)

    def close(self) -> None:
        self._channel.close()

    def _receive(self, timeout: float) -> Step | Show | None:
        try:
            command = self._channel.receive(timeout)
        except EOFError:  # the clock has ended, and the runner will end this service
            time.sleep(_MEANWHILE)
            return None
        assert not isinstance(command, Done), "the clock gives commands"
        return command

    def drain(self, observe: Callable[[Envelope], None]) -> bool:
        """Take the bus: messages of services come with the steps, and the runner's begin, too."""
        has_heard = False
        for envelope in islice(iter(self._session.receive, None), _MOST):
            has_heard, source = True, self._session.source
            is_of_service = self._book.knows(source, envelope.received) and source not in (
                self._book.addresses.get(RUNNER),
                self._book.addresses.get(HEARTBEAT),
            )
            if envelope.data_type != self._begin and not is_of_service:
                observe(envelope)
        return has_heard
