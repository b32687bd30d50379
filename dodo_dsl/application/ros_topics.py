"""``x-dodo: {ros: {in: ..., out: ...}}``: the topics of a ROS 2 node as they are written, and the bridge to them."""

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from dodo_dsl import source
from dodo_dsl.diagnostics import Span
from dodo_dsl.opendlv.ros_types import NODE_ENVIRONMENT, SENT, Topic
from dodo_dsl.source import Node, Scalar
from dodo_dsl.spec.quantity import QuantityError, convert

BRIDGE = "dodo-ros-bridge"
"""The service between the test's bus and the application's ROS graph, and the name of its log."""
BRIDGE_IMAGE = "ros-bridge"
BRIDGE_MODULE = "services.ros_bridge"
_NODE = f"""\
image: {BRIDGE_IMAGE}
network_mode: host
ipc: host
volumes: [{{type: bind, source: /tmp, target: /tmp}}]
command: [--cid=111]
x-dodo-process: [python, -m, {BRIDGE_MODULE}]
"""
_SHORT = re.compile(r"\A(\w+)/(\w+)\Z")
"""A type as some tools accept it."""

Word = tuple[str, Span]


@dataclass(frozen=True)
class RosTopic:
    """A topic as it is written, with its places; it is ``given`` to the node, or else sent by it.

    ``ports`` are the words of ``from`` or ``to``.
    """

    topic: Topic
    given: bool
    span: Span
    type_span: Span
    ports: tuple[Word, ...] = ()

    @property
    def messages(self) -> tuple[Word, ...]:
        return self.ports or tuple((name, self.span) for name in SENT.get(self.topic.type, ()))


def ros_topics(node: Node | None) -> Iterator[RosTopic]:
    """The topics of the value of ``ros``, as far as they fit the schema."""
    for key, ports in (("in", "from"), ("out", "to")):
        for name, entry in source.entries(node, key).items():
            about = source.plain(entry.value)
            keys: dict[str, Any] = {"type": about} if isinstance(about, str) else about
            word = entry.value if isinstance(about, str) else source.part(entry.value, "type")
            with contextlib.suppress(AttributeError, KeyError, QuantityError, TypeError, msgspec.ValidationError):
                keys |= {"topic": name, "bus": (), **keys.pop("qos", {})}
                keys["type"] = _SHORT.sub(r"\1/msg/\2", keys["type"])
                keys["rate"] = float(convert(keys["rate"], "Hz")) if "rate" in keys else 0.0
                topic = msgspec.convert(keys, Topic)
                place = word.span if word else entry.key
                yield RosTopic(topic, key == "in", entry.key, place, tuple(_words(source.part(entry.value, ports))))


def _words(node: Node | None) -> Iterator[Word]:
    for item in node.items if isinstance(node, source.Sequence) else (node,):
        if isinstance(item, Scalar):
            yield item.text, item.span


_GRAPH = {"ROS_LOCALHOST_ONLY": "0", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
_DOMAINS = 102
"""Domains whose ports lie below those that Linux gives programs; beyond them, CIDs begin anew at 1."""


def variables(cid: int, *, own_network: bool) -> tuple[dict[str, str], dict[str, str]]:
    """Environment variables of all nodes of a test: those that it sets, and those that a service may set otherwise.

    On the host's network, each test has another domain.
    """
    domain = 0 if own_network else cid if cid < _DOMAINS else cid - _DOMAINS + 1
    return {**_GRAPH, "ROS_DOMAIN_ID": str(domain)}, dict(NODE_ENVIRONMENT)


def bridge() -> source.Mapping:
    node, problems = source.parse(_NODE, BRIDGE)
    assert isinstance(node, source.Mapping), problems
    return node
