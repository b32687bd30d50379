"""The services of a test: their addresses, who may send what, and what the application must not hear."""

import math
import os
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.address import CHANNEL_VARIABLE, LINES, Address, is_of_the_world
from dodo_dsl.opendlv.address_book import HEARTBEAT, RUNNER, AddressBook
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base.clock import MICROSECONDS
from services.base.runner import tell

Key = tuple[int, int | None]
"""Id and sender stamp of a message; None is any stamp."""

VARIABLE = "DODO_SENDERS"
"""Environment variable with words such as ``opendlv.sim.Frame/0=pose``; no service behind ``=``: nobody may send it.

``my-pose?`` is a service that may not say from where it sends. Without a sender stamp all of them are meant.
"""
END_OF_INPUT, NOT_SHOWN = "dodo.EndOfInput", "dodo.NotShown"
RUNNER_ONLY = {"dodo.TestBegin": RUNNER, "dodo.LinesRead": RUNNER, "dodo.Alive": HEARTBEAT}
"""Messages of the runner, with the name of the address from which they come."""


class Producers(NamedTuple):
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
        only = f"{', '.join(others)} and {last}" if others else last
        who = f"only {only} may send" if only else "no service of this test sends"
        return f"the application sent {self.message}, which {who}"


class SenderTable:
    """The producers by message; reports, once for each message, that the application has sent one of theirs."""

    def __init__(self, messages: MessageSet) -> None:
        """The table that the environment names, empty without one; raises ValueError for words that make none."""
        self.by_message: dict[Key, Producers] = {}
        self.book = AddressBook(channel())
        self._of_runner = {messages.id(name): name for name in RUNNER_ONLY}
        self._reported: set[str] = set()
        for word in os.environ.get(VARIABLE, "").split():
            message, _, names = word.partition("=")
            written = [name for name in names.split(",") if name]
            silent = frozenset(name.removesuffix("?") for name in written if name.endswith("?"))
            producers = Producers(message, tuple(name.removesuffix("?") for name in written), silent)
            self.by_message[messages.key(message)] = producers
            if message == END_OF_INPUT:  # the same services show what may be answered
                self.by_message[messages.key(NOT_SHOWN)] = producers._replace(message=NOT_SHOWN)
        self.ids = frozenset([*self._of_runner, *(id_ for id_, _ in self.by_message)])
        """Of all messages that not everybody may send."""

    def producers(self, envelope: Envelope) -> Producers | None:
        """Those of a message; None for one that anybody may send."""
        of_stamp, of_any = _keys_of(envelope)
        return self.by_message.get(of_stamp) or self.by_message.get(of_any)

    def address(self, name: str) -> Address | None:
        """Of a service, or of the runner."""
        self.book.read()
        return self.book.addresses.get(name)

    def is_of_runner(self, envelope: Envelope, source: Address) -> bool:
        """Whether the runner sent a message that only it may send, True for all others; reports one that it did not."""
        name = self._of_runner.get(envelope.data_type)
        if name is None or source == self.address(RUNNER_ONLY[name]):
            return True
        self.report(f"the application sent {name}, which only the runner may send")
        return False

    def check_numbers(self, message: Message, stamp: int, takers: Sequence[str], elapsed: int | None) -> None:
        """Report a number of the application's that is not finite, for services, ``elapsed`` us after the start."""
        name = f"{message.DESCRIPTOR.full_name}/{stamp}"
        if name not in self._reported and (number := _infinite_number(message)):
            self._reported.add(name)
            when = "before the test began" if elapsed is None else f"after {elapsed / MICROSECONDS:.2f} s"
            to = " and ".join(f"'{taker}'" for taker in takers)
            self.report(f"the application sent {name} to {to} {when}: {number}, not a finite number")

    def report(self, reason: str) -> None:
        if reason not in self._reported:
            self._reported.add(reason)
            tell("foreign", reason=reason)


def _infinite_number(message: Message, inside: str = "") -> str:
    """The first number of a message that is not finite, as ``groundSteering is nan``; empty if all are."""
    for about, value in message.ListFields():
        if isinstance(value, float) and not math.isfinite(value):
            return f"{inside}{about.name} is {value}"
        if isinstance(value, Message) and (found := _infinite_number(value, f"{inside}{about.name}.")):
            return found
    return ""


WORLD_VARIABLE = "DODO_WORLD"
"""Environment variable with the names of the test's services, those of DoDo's own programs alone.

``my-eval?=opendlv.sim.Frame/0,opendlv.sim.Command`` is one that may not say where it listens, with the messages of the
world that it consumes.
"""
TRUTH = "DODO_TRUTH"
"""Environment variable with the messages by which evaluators judge, which the application never gets."""
TOLD = "DODO_TOLD"
"""Environment variable with the messages of the world that the application declares to take, and so gets."""


class World:
    """Messages of the world by id; without any, as outside of tests, nothing is kept from the bus.

    ``silent`` are the services that may not say where they listen, with what they consume. ``told`` are messages of the
    world that the application gets; ``truth`` is what evaluators judge by.
    """

    def __init__(self, messages: MessageSet) -> None:
        """What the environment names, empty without it; raises ValueError for words that make none."""

        def keys(words: Iterable[str]) -> frozenset[Key]:
            return frozenset(messages.key(word) for word in words if word)

        words = os.environ.get(WORLD_VARIABLE, "").split()
        entries = [word.partition("?=") for word in words]
        self.silent = {name: keys(written.split(",")) for name, mark, written in entries if mark}
        self.names = {messages.id(name): name for name in messages.names() if is_of_the_world(name)} if words else {}
        self.told, self.truth = (keys(os.environ.get(variable, "").split()) for variable in (TOLD, TRUTH))

    def holds(self, envelope: Envelope) -> bool:
        """Whether a message must not come to the bus."""
        keys = _keys_of(envelope)
        return not self.truth.isdisjoint(keys) or (envelope.data_type in self.names and self.told.isdisjoint(keys))

    def awaited_by(self, envelope: Envelope) -> list[str]:
        """Those of the services that may not say where they listen who consume a message."""
        return [name for name, keys in self.silent.items() if not keys.isdisjoint(_keys_of(envelope))]


def _keys_of(envelope: Envelope) -> tuple[Key, Key]:
    return (envelope.data_type, envelope.sender_stamp), (envelope.data_type, None)


_UNATTENDED_S = 10.0
"""After which services count as ready where no runner reports it."""


class Members:
    """Separates the messages of the test's services from the application's, and sends to them alone."""

    def __init__(self, session: Session, name: str, table: SenderTable, world: World) -> None:
        self._session, self._name, self._table, self._book = session, name, table, table.book
        self._world = world
        self._overheard: set[int] = set()
        """Messages of the world that had to come to the bus."""
        self._silent_from = time.monotonic() + _UNATTENDED_S
        """When services that have not entered their address are known to be others than DoDo's."""

    def admits(self, envelope: Envelope) -> bool:
        """Whether the message that the session received last counts; reports one that must not be to the runner."""
        source = self._session.source
        if envelope.data_type not in self._table.ids:
            return not self._session.was_direct or self._book.knows(source, envelope.received)
        if not self._table.is_of_runner(envelope, source):
            return False
        producers = self._table.producers(envelope)
        if producers is None:
            return True
        is_known, addresses = self._book.knows(source, envelope.received), self._book.addresses
        is_possible = LINES in producers.services or source != addresses.get(RUNNER)
        if is_possible and (is_known or any(name not in addresses for name in producers.silent)):
            return True
        self._table.report(producers.reason)
        return False

    def check_numbers(self, envelope: Envelope, message: Message, elapsed: int | None) -> None:
        """Report the message that the session received last if the application sent it, and a number is not finite."""
        producers = self._table.producers(envelope)
        is_known = self._book.knows(self._session.source, envelope.received)
        if not is_known if producers is None else LINES in producers.services:
            self._table.check_numbers(message, envelope.sender_stamp, [self._name], elapsed)

    def send(self, envelope: Envelope) -> None:
        """Send a message of the world to the test's services alone.

        From the start of the test on, what a service of the deployment consumes that does not say where it listens
        comes to the bus.
        """
        self._book.read()
        silent = [name for name in self._world.awaited_by(envelope) if name not in self._book.addresses]
        if not silent or time.monotonic() < self._silent_from:
            own = self._session.address
            self._session.send_directly(envelope, [other for other in self._book.present if other != own])
            return
        if envelope.data_type not in self._overheard:
            self._overheard.add(envelope.data_type)
            why = f"'{silent[0]}' does not use DoDo's base for services"
            text = f"the application can hear {self._world.names[envelope.data_type]}, as service {why}"
            tell("note", text=text)
        self._session.send_envelope(envelope)

    def begin(self) -> None:
        """The test begins: all of its services are ready, and have entered their addresses if they ever do."""
        self._silent_from = min(self._silent_from, time.monotonic())


def channel() -> Path | None:
    """The folder where the test's services meet; None outside of tests."""
    folder = os.environ.get(CHANNEL_VARIABLE)
    return Path(folder) if folder else None
