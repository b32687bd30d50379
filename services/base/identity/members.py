"""The services of a test in real time: each says its address, with a proof that it has the key.

From there it sends, and there it gets what the application must not hear.
"""

import json
import time
from collections.abc import Sequence
from typing import Any

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.proof import is_proven, with_proof
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.codec import MessageError
from services.base.identity.senders import Producers, SenderTable
from services.base.identity.world import World

SENDER = "dodo.Sender"
_AGAIN_S = 0.1
_MISSING_S = 0.5
_UNATTENDED_S = 10.0
"""After which services count as ready where no runner tells of it."""


class Members:
    """Learns the addresses of the test's services, and tells their messages from the application's.

    A service says its address before it is ready, and again when another asks. The application starts when all are
    ready, so that it comes too late to be taken for one of them, even where there is no key, as without a runner.
    """

    def __init__(self, session: Session, name: str, table: SenderTable, world: World | None = None) -> None:
        self._session, self._name, self._table = session, name, table
        self._world = world or World()
        self._overheard: set[int] = set()
        """Messages of the world that had to come to the bus."""
        self._silent_from: float | None = None if table.key else time.monotonic() + _UNATTENDED_S
        """When services that have not said their address are known to be others than DoDo's; None before the begin."""
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
        """Whether the message that the session received last counts; tells the runner of one that must not be."""
        is_stranger = self._session.was_direct and self._session.source not in self._known
        if envelope.data_type not in self._ids:
            return not is_stranger
        if envelope.data_type == self._id:
            self._learn(envelope)
            return False
        if not self._table.is_of_runner(envelope):
            return False
        producers = self._table.producers(envelope)
        return producers is None or self._session.source in self._known or self._is_excused(producers)

    def send(self, envelope: Envelope) -> bytes:
        """Send a message of the world to the test's services alone, and return its frame.

        From the begin of the test on, what a service of the deployment consumes that does not say where it listens
        comes to the bus.
        """
        silent = [name for name in self._world.awaited_by(envelope) if name not in self._addresses]
        if not silent or self._silent_from is None or time.monotonic() < self._silent_from:
            return self._session.send_directly(envelope, self._others)
        if envelope.data_type not in self._overheard:
            self._overheard.add(envelope.data_type)
            why = f"'{silent[0]}' does not use DoDo's base for services"
            text = f"the application can hear {self._world.names[envelope.data_type]}, as service {why}"
            print(json.dumps({"dodo": "note", "text": text}), flush=True)
        return self._session.send_envelope(envelope)

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
