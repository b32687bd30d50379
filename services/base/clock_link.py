"""A service's link to the clock of a test in lockstep, beside the bus, which only a service that observes it hears."""

import select
import time
from collections.abc import Callable
from pathlib import Path

from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.channel import Channel, Done, Show, Step
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.packets import CLOCK_SOCKET
from dodo_dsl.opendlv.session import Session
from services.base.members import channel

SLICE_S = 0.1
_MEANWHILE = 0.003
"""Seconds that an observer of the bus waits after a message, so that it wakes once for several."""


def socket_path() -> Path:
    """Where the clock listens; raises ValueError where the environment names no folder."""
    if (folder := channel()) is None:
        raise ValueError(f"{CHANNEL_VARIABLE} names no folder where services meet the clock")
    return folder / CLOCK_SOCKET


class ClockClient:
    """Receives commands and answers them. It waits for the clock."""

    is_over = False

    def __init__(self, session: Session, name: str, path: Path | None = None) -> None:
        self._session = session
        self._channel = Channel.connect(path or socket_path(), name)
        self._begin = session.messages.id("dodo.TestBegin")
        self._pause = 0.001

    def next(self, observes: bool, observe: Callable[[Envelope], None]) -> Step | Show | None:
        """The next command, or None after a while; ``observe`` takes everything that was on the bus before it."""
        if not observes:
            self._session.deafen()
            return self._receive(SLICE_S)
        command = self._receive(0.0)
        if self._drain(observe) and command is None:
            select.select([self._channel], [], [], _MEANWHILE)
        elif command is None:
            select.select([self._channel.fileno(), self._session.fileno()], [], [], SLICE_S)
        return command

    def answer(self, done: Done) -> None:
        self._channel.send(done)

    def close(self) -> None:
        self._channel.close()

    def _receive(self, timeout: float) -> Step | Show | None:
        try:
            command = self._channel.receive(timeout)
        except EOFError:  # the clock has ended, and the runner will end this service
            time.sleep(self._pause)
            self._pause = min(2 * self._pause, SLICE_S)
            return None
        assert not isinstance(command, Done), "the clock gives commands"
        return command

    def _drain(self, observe: Callable[[Envelope], None]) -> int:
        taken = 0
        while (envelope := self._session.receive(0.0)) is not None:
            if envelope.data_type != self._begin:
                observe(envelope)
            taken += 1
        return taken
