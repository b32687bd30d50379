"""What the clock of a test in lockstep and its services say to each other past the bus: typed messages.

Each service connects to the clock before it is ready, so before the application starts.
"""

import math
import operator
from pathlib import Path
from typing import Self

import msgspec
from msgspec import Struct

from dodo_dsl.opendlv.address import Address
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.packets import Connection


class Step(Struct, tag=True, array_like=True):
    """The clock lets a service go on to a time (us) with all that it has not heard yet; Done follows."""

    time: int
    messages: list[Envelope]


class Show(Struct, tag=True, array_like=True):
    """The service ``awaits`` readers of its new pictures, ``announces`` these, or does both; Done follows."""

    awaits: bool
    announces: bool


class About(Struct, array_like=True):
    """Of a service that has built its model: from where it sends on the bus, and its number of shared memories."""

    address: Address
    memories: int
    consumes: list[int]
    """Ids of the messages that it handles; empty for all."""


class Done(Struct, tag=True, array_like=True):
    """A service has done what it was to do, and sent these messages meanwhile; ``about`` is in the first one alone.

    ``pictures`` are new ones, ``sampled`` is when the newest was (us), and ``next`` when it has something to say next,
    0 when it does not know. ``awaited`` says that readers of new pictures wait for them already.
    """

    service: str
    messages: list[Envelope]
    pictures: int = 0
    sampled: int = 0
    next: int = 0
    ended: bool = False
    about: About | None = None
    awaited: bool = False


Message = Step | Show | Done
_encode = msgspec.msgpack.Encoder(enc_hook=operator.index).encode  # numbers of numpy
_decode = msgspec.msgpack.Decoder(Message).decode


class Channel:
    """One end of a connection between the clock and a service."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self.fileno, self.close = connection.fileno, connection.close

    @classmethod
    def connect(cls, path: Path, name: str) -> Self:
        return cls(Connection.open(path, name, math.inf))

    def send(self, message: Message) -> None:
        self._connection.send(_encode(message))

    def receive(self, timeout: float) -> Message | None:
        data = self._connection.receive(timeout)
        message: Message | None = None if data is None else _decode(data)
        return message
