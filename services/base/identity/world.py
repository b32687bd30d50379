"""The messages of a test that travel where its application is not, and the services that get them."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Self

from dodo_dsl.opendlv.bus.address import is_of_the_world
from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.message_set import MessageSet

VARIABLE = "DODO_WORLD"
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
        words = os.environ.get(VARIABLE, "").split()
        if not words and os.environ.get(TRUTH, "").split():
            raise ValueError(f"{TRUTH} names what the application must not get, and {VARIABLE} no service that gets it")
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
