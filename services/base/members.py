"""The services of a test: their key, their addresses, who may send what, and what the application must not hear.

In real time each says its address, with a proof that it has the key: DoDo's services alone have it, the application
never. From there it sends, and there it gets what the application must not hear. The table of who may send which
message is made by the compiler, of the wiring.
"""

import ctypes
import json
import math
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

from google.protobuf.message import Message

from dodo_dsl.opendlv.address import LINES, Address, is_of_the_world
from dodo_dsl.opendlv.authentication import KEY_VARIABLE, is_proven, with_proof
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.session import Session
from services.base.clock import MICROSECONDS

VARIABLE = "DODO_SENDERS"
"""Environment variable with words such as ``opendlv.sim.Frame/0=pose``; no service behind ``=``: nobody may send it.

``my-pose?`` is a service that may not say from where it sends. Without a sender stamp all of them are meant.
"""
END_OF_INPUT, NOT_SHOWN = "dodo.EndOfInput", "dodo.NotShown"
RUNNER_ONLY = ("dodo.TestBegin", "dodo.Alive")
"""Messages of the runner, which prove themselves."""
_MOST_NAMED = 3


@dataclass(frozen=True)
class Producers:
    """The ``services`` that alone may send a message; ``silent`` are those that may not say from where."""

    message: str
    services: tuple[str, ...] = ()
    silent: frozenset[str] = frozenset()

    @property
    def reason(self) -> str:
        """Why a test fails in which the application sent the message."""
        if self.services == (LINES,):
            return f"the application sent {self.message}, which it declares to print (x-dodo: lines)"
        *others, last = [f"'{name}'" for name in self.services] or [""]
        who = f"only {', '.join(others)} and {last} may send" if others else f"only {last} may send"
        if not self.services:
            who = "no service of this test sends"
        elif len(self.services) > _MOST_NAMED:
            who = "only services of the test may send"
        return f"the application sent {self.message}, which {who}"


@dataclass
class SenderTable:
    """The producers by message; reports, once for each message, that the application has sent one of theirs."""

    messages: MessageSet
    key: bytes = b""
    by_message: dict[tuple[int, int | None], Producers] = field(default_factory=dict)
    _reported: set[str] = field(default_factory=set)
    _of_runner: dict[int, str] = field(init=False)

    def __post_init__(self) -> None:
        self._of_runner = {self.messages.id(name): name for name in RUNNER_ONLY}

    @classmethod
    def load(cls, messages: MessageSet, key: bytes) -> Self:
        """The table that the environment names, empty without one; raises ValueError for words that make none."""
        return cls(messages, key, dict(_entries(os.environ.get(VARIABLE, ""), messages)))

    @property
    def ids(self) -> frozenset[int]:
        """Ids of all messages that not everybody may send."""
        return frozenset([*self._of_runner, *(id_ for id_, _ in self.by_message)])

    @property
    def services(self) -> frozenset[str]:
        """All services in the table."""
        return frozenset(name for each in self.by_message.values() for name in each.services)

    def producers(self, envelope: Envelope) -> Producers | None:
        """Those of a message; None for one that anybody may send."""
        of_stamp = self.by_message.get((envelope.data_type, envelope.sender_stamp))
        return of_stamp or self.by_message.get((envelope.data_type, None))

    def is_of_runner(self, envelope: Envelope) -> bool:
        """Whether a message of the runner proves itself, which the others need not; reports one that does not."""
        name = self._of_runner.get(envelope.data_type)
        if name is None or is_proven(self.key, envelope.data_type, envelope.payload):
            return True
        self.report(f"the application sent {name}, which only the runner may send")
        return False

    def is_of(self, service: str, envelope: Envelope, source: Address) -> bool:
        """Whether a message of the type SENDER proves that its ``source`` is this service's address."""
        if not is_proven(self.key, envelope.data_type, envelope.payload):
            return False
        try:
            said: Any = self.messages.decode(envelope.data_type, envelope.payload)
        except MessageError:
            return False
        return said.service == service and (said.host, said.port) == source

    def check_numbers(self, message: Message, stamp: int, takers: Sequence[str], elapsed: int | None) -> None:
        """Report a number of the application's that is not finite, for services, ``elapsed`` us after the start."""
        name = f"{message.DESCRIPTOR.full_name}/{stamp}"
        if name not in self._reported and (number := _infinite_number(message)):
            self._reported.add(name)
            when = "before the test began" if elapsed is None else f"after {elapsed / MICROSECONDS:.2f} s"
            to = " and ".join(f"'{taker}'" for taker in takers)
            self.report(f"the application sent {name} to {to} {when}: {number}, not a finite number")

    def report(self, reason: str) -> None:
        """Report to the runner why the test fails."""
        if reason not in self._reported:
            self._reported.add(reason)
            print(json.dumps({"dodo": "foreign", "reason": reason}), flush=True)


def _infinite_number(message: Message, inside: str = "") -> str:
    """The first number of a message that is not finite, as ``groundSteering is nan``; empty if all are."""
    for about, value in message.ListFields():
        if isinstance(value, float) and not math.isfinite(value):
            return f"{inside}{about.name} is {value}"
        if isinstance(value, Message) and (found := _infinite_number(value, f"{inside}{about.name}.")):
            return found
    return ""


def _entries(text: str, messages: MessageSet) -> Iterator[tuple[tuple[int, int | None], Producers]]:
    for word in text.split():
        message, _, names = word.partition("=")
        name, _, stamp = message.partition("/")
        if stamp and not stamp.isdecimal():
            raise ValueError(f"{VARIABLE}: '{message}' has no whole number as its sender stamp")
        written = [each for each in names.split(",") if each]
        silent = frozenset(each.removesuffix("?") for each in written if each.endswith("?"))
        services = tuple(each.removesuffix("?") for each in written)
        yield (messages.id(name), int(stamp) if stamp else None), Producers(message, services, silent)
        if name == END_OF_INPUT:  # the same services show what may be answered
            yield (messages.id(NOT_SHOWN), None), Producers(NOT_SHOWN, services, silent)


WORLD_VARIABLE = "DODO_WORLD"
"""Environment variable with the names of the test's services, those of DoDo's own programs alone.

``my-eval?=opendlv.sim.Frame/0,opendlv.sim.Command`` is one that may not say where it listens, with the messages of the
world that it consumes.
"""
TRUTH = "DODO_TRUTH"
"""Environment variable with the messages by which evaluators judge, which the application never gets."""
TOLD = "DODO_TOLD"
"""Environment variable with the messages of the world that the application declares to take, and so gets."""

Key = tuple[int, int | None]
"""Id and sender stamp of a message; None is any stamp."""


@dataclass(frozen=True)
class World:
    """The ``services`` of a test; without any, as outside of tests, nothing is kept from the bus.

    ``silent`` are those that may not say where they listen, with what they consume. ``told`` are messages of the world
    that the application gets, ``ids`` all others, ``names`` those of both; ``truth`` is what evaluators judge by.
    """

    services: frozenset[str] = frozenset()
    silent: Mapping[str, frozenset[Key]] = field(default_factory=dict)
    told: frozenset[Key] = frozenset()
    truth: frozenset[Key] = frozenset()
    ids: frozenset[int] = frozenset()
    names: Mapping[int, str] = field(default_factory=dict)

    @classmethod
    def load(cls, messages: MessageSet) -> Self:
        """What the environment names, empty without it; raises ValueError for words that make none."""
        words = os.environ.get(WORLD_VARIABLE, "").split()
        if not words and os.environ.get(TRUTH, "").split():
            raise ValueError(
                f"{TRUTH} names what the application must not get, and {WORLD_VARIABLE} no service that gets it"
            )
        if not words:
            return cls()
        entries = [word.partition("?=") for word in words]
        silent = {name: _keys(written.split(","), messages) for name, mark, written in entries if mark}
        names = {messages.id(name): name for name in messages.names() if is_of_the_world(name)}
        told, truth = (_keys(os.environ.get(variable, "").split(), messages) for variable in (TOLD, TRUTH))
        services = frozenset(name for name, mark, _ in entries if not mark)
        return cls(services, silent, told, truth, frozenset(names), names)

    def __bool__(self) -> bool:
        return bool(self.services or self.silent)

    def holds(self, envelope: Envelope) -> bool:
        """Whether a message must not come to the bus."""
        keys = _keys_of(envelope)
        return not self.truth.isdisjoint(keys) or (envelope.data_type in self.ids and self.told.isdisjoint(keys))

    def awaited_by(self, envelope: Envelope) -> list[str]:
        """Those of the services that may not say where they listen who consume a message."""
        return [name for name, keys in self.silent.items() if not keys.isdisjoint(_keys_of(envelope))]


def _keys(words: Iterable[str], messages: MessageSet) -> frozenset[Key]:
    parts = (word.partition("/") for word in words if word)
    return frozenset((messages.id(name), int(stamp) if stamp else None) for name, _, stamp in parts)


def _keys_of(envelope: Envelope) -> tuple[Key, Key]:
    return (envelope.data_type, envelope.sender_stamp), (envelope.data_type, None)


SENDER = "dodo.Sender"
_AGAIN_S = 0.1
_MISSING_S = 0.5
_UNATTENDED_S = 10.0
"""After which services count as ready where no runner reports it."""


class Members:
    """Learns the addresses of the test's services, and separates their messages from the application's.

    A service says its address before it is ready, and again when another asks. The application starts when all are
    ready, so that it comes too late to be taken for one of them, even if there is no key, as without a runner.
    """

    def __init__(self, session: Session, name: str, table: SenderTable, world: World | None = None) -> None:
        self._session, self._name, self._table = session, name, table
        self._world = world or World()
        self._overheard: set[int] = set()
        """Messages of the world that had to come to the bus."""
        self._silent_from: float | None = None if table.key else time.monotonic() + _UNATTENDED_S
        """When services that have not said their address are known to be others than DoDo's; None before the start."""
        self._id, self._type = session.messages.id(SENDER), session.messages.type(SENDER)
        self._ids = table.ids | {self._id}
        self._addresses: dict[str, Address | None] = {}
        """None for a service that has left: another program may have got its port."""
        self._known: frozenset[Address] = frozenset()
        self._others: list[Address] = []
        self._asked = 0.0

    def join(self) -> None:
        """Say from where this service sends, and ask the others."""
        self._asked = time.monotonic()
        self._say(asks=True)

    def leave(self) -> None:
        """Nothing more will come from this service."""
        self._say(self._others, leaves=True)

    def admits(self, envelope: Envelope) -> bool:
        """Whether the message that the session received last counts; reports one that must not be to the runner."""
        is_stranger = self._session.was_direct and self._session.source not in self._known
        if envelope.data_type not in self._ids:
            return not is_stranger
        if envelope.data_type == self._id:
            self._learn(envelope)
            return False
        if not self._table.is_of_runner(envelope):
            return False
        producers = self._table.producers(envelope)
        if producers is None:
            return True
        if LINES in producers.services or self._session.source != self._addresses.get(LINES):
            return self._session.source in self._known or self._is_excused(producers)
        self._table.report(producers.reason)  # printed, and of a service of the test
        return False

    def check_numbers(self, envelope: Envelope, message: Message, elapsed: int | None) -> None:
        """Report the message that the session received last if the application sent it, and a number is not finite."""
        producers = self._table.producers(envelope)
        if self._session.source not in self._known if producers is None else LINES in producers.services:
            self._table.check_numbers(message, envelope.sender_stamp, [self._name], elapsed)

    def send(self, envelope: Envelope) -> None:
        """Send a message of the world to the test's services alone.

        From the start of the test on, what a service of the deployment consumes that does not say where it listens
        comes to the bus.
        """
        silent = [name for name in self._world.awaited_by(envelope) if name not in self._addresses]
        if not silent or self._silent_from is None or time.monotonic() < self._silent_from:
            self._session.send_directly(envelope, self._others)
            return
        if envelope.data_type not in self._overheard:
            self._overheard.add(envelope.data_type)
            why = f"'{silent[0]}' does not use DoDo's base for services"
            text = f"the application can hear {self._world.names[envelope.data_type]}, as service {why}"
            print(json.dumps({"dodo": "note", "text": text}), flush=True)
        self._session.send_envelope(envelope)

    def begin(self) -> None:
        """The test begins: all of its services are ready, and have said their addresses if they ever do."""
        self._silent_from = self._silent_from or time.monotonic()

    def ask_for_missing(self) -> None:
        """Ask now and then for the addresses of services that have not said theirs: a message may be lost."""
        missing = self._world.services - self._addresses.keys() - {self._name}
        if missing and time.monotonic() - self._asked > _MISSING_S:
            self.join()

    def _is_excused(self, producers: Producers) -> bool:
        """A message from an unknown address: counts if it may be of a service that does not say its own.

        It is the application's as soon as all addresses are known from which it may come.
        """
        unknown = [name for name in producers.services if name not in self._addresses]
        if unknown:
            if time.monotonic() - self._asked > _AGAIN_S:
                self.join()
            return not producers.silent.isdisjoint(unknown)
        self._table.report(producers.reason)
        return False

    def _say(self, to: Sequence[Address] = (), asks: bool = False, leaves: bool = False) -> None:
        """To these addresses, where the application does not hear it; else on the bus."""
        host, port = self._session.address
        message = self._type(service=self._name, host=host, port=port, asks=asks, leaves=leaves)
        payload = with_proof(self._table.key, self._id, self._session.messages.encode(message))
        now = time.time_ns() // 1000
        envelope = Envelope(self._id, payload, now, 0, now, 0)
        if to and self._world:
            self._session.send_directly(envelope, to)
        else:
            self._session.send_envelope(envelope)

    def _learn(self, envelope: Envelope) -> None:
        """The first address of a service counts, until it leaves: that of the application would come later."""
        if not is_proven(self._table.key, self._id, envelope.payload):
            return
        try:
            said: Any = self._session.messages.decode(self._id, envelope.payload)
        except MessageError:
            return
        source = self._session.source
        if (said.host, said.port) != source:
            return
        if said.asks:
            self._say([source])
        if said.service not in self._table.services and not self._is_of_the_world(said.service):
            return
        if self._addresses.setdefault(said.service, source) == source and said.leaves:
            self._addresses[said.service] = None
        self._known = frozenset(address for address in self._addresses.values() if address is not None)
        self._others = sorted(self._known)

    def _is_of_the_world(self, service: str) -> bool:
        return service in self._world.services or service in self._world.silent


def take_key() -> bytes:
    """The key that the runner gave this process, empty if there is none; raises ValueError for one that is none.

    Afterwards neither the processes that this one starts find it nor those that read ``/proc/PID/environ``.
    """
    libc = ctypes.CDLL(None)
    libc.getenv.restype = ctypes.c_void_p
    place = libc.getenv(KEY_VARIABLE.encode())
    if place:
        ctypes.memset(place, ord("0"), len(ctypes.string_at(place)))
    return bytes.fromhex(os.environ.pop(KEY_VARIABLE, ""))
