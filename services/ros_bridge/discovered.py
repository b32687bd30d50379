"""What discovery has told of the application's graph: participants, their nodes, and who has which topic."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

_NAMELESS = "a program"
_LIMIT = 10_000


@dataclass(frozen=True)
class Endpoint:
    """A publisher or a subscription; ``topic`` is ROS' name, empty where it is none, as of services."""

    guid: bytes
    participant: bytes
    topic: str
    type: str
    writes: bool
    reliable: bool = True
    durable: bool = False

    def meets(self, other: "Endpoint") -> bool:
        """Whether this publisher's messages come to that subscription of its topic."""
        return not self.type_differs(other) and not self.lacks(other)

    def type_differs(self, other: "Endpoint") -> bool:
        return self.type != other.type

    def lacks(self, reader: "Endpoint") -> str:
        """Which of its qualities a subscription wants and does not get."""
        if reader.reliable and not self.reliable:
            return "reliability"
        return "durability" if reader.durable and not self.durable else ""


@dataclass
class Discovered:
    """Fed by a graph; a bound keeps it small whatever comes."""

    endpoints: dict[bytes, Endpoint] = field(default_factory=dict)
    names: dict[bytes, str] = field(default_factory=dict)
    participants: set[bytes] = field(default_factory=set)
    nodes: dict[bytes, set[str]] = field(default_factory=dict)
    """By their participants, also of those that have left."""
    left: set[bytes] = field(default_factory=set)
    changes: int = 0

    def participant(self, key: bytes, is_there: bool) -> None:
        if is_there and len(self.participants) < _LIMIT:
            self.participants.add(key)
            self.left.discard(key)
        elif key in self.participants:
            self.participants.discard(key)
            self.left.add(key)
        self.changes += 1

    def endpoint(self, endpoint: Endpoint) -> None:
        if len(self.endpoints) < _LIMIT:
            self.endpoints[endpoint.guid] = endpoint
            self.changes += 1

    def gone(self, guid: bytes) -> None:
        self.endpoints.pop(guid, None)
        self.changes += 1

    def named(self, participant: bytes, node: str, guids: Iterable[bytes]) -> None:
        if len(self.names) < _LIMIT:
            self.nodes.setdefault(participant, set()).add(node)
            self.names.update(dict.fromkeys(guids, node))
            self.changes += 1

    def name(self, endpoint: Endpoint) -> str:
        """Of its node."""
        known = self.nodes.get(endpoint.participant, set())
        return f"'{self.names.get(endpoint.guid) or next(iter(sorted(known)), '')}'".replace("''", _NAMELESS)

    def of(self, topic: str, writes: bool) -> list[Endpoint]:
        """Who publishes a topic, or hears it."""
        return [each for each in self.endpoints.values() if each.topic == topic and each.writes == writes]

    def topics(self, writes: bool) -> Iterator[Endpoint]:
        """All publishers, or subscriptions, of ROS topics but those that each node has."""
        for each in self.endpoints.values():
            if each.topic and each.writes == writes and each.topic not in OF_EACH_NODE:
                yield each


OF_EACH_NODE = ("/rosout", "/parameter_events", "/clock", "/tf", "/tf_static")
