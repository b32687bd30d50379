"""``x-dodo: {ros: {in: ..., out: ...}}``: the topics of a ROS 2 node as they are written, and the bridge to them.

The bridge is a service of DoDo's that stands beside the application's own, in their network, memory and time.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from dodo_dsl import source
from dodo_dsl.diagnostics import Span
from dodo_dsl.opendlv.ros_types import NODE_ENVIRONMENT, SENT
from dodo_dsl.source import Node, Scalar
from dodo_dsl.spec import quantity

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
_SHORT = re.compile(r"([A-Za-z][A-Za-z0-9_]*)/([A-Za-z][A-Za-z0-9]*)")
"""A type as some tools accept it."""

Word = tuple[str, Span]


@dataclass(frozen=True)
class RosTopic:
    """A topic as it is written, with its place; it is ``given`` to the node, or else sent by it.

    ``type`` is ``package/msg/Name``; ``ports`` are the words of ``from`` or ``to``.
    """

    name: str
    span: Span
    given: bool
    type: str
    type_span: Span
    ports: tuple[Word, ...] = ()
    encoding: str = ""
    frame_id: str = ""
    reliability: str = ""
    durability: str = ""
    depth: int = 10
    rate: float = 0.0
    fields: Mapping[str, str] = field(default_factory=dict)

    @property
    def messages(self) -> tuple[Word, ...]:
        """The messages that a sent topic becomes, by what is written or by its type."""
        return self.ports or tuple((name, self.span) for name in SENT.get(self.type, ()))


def ros_topics(node: Node | None) -> tuple[RosTopic, ...]:
    """The topics of the value of ``ros``, as far as they fit the schema."""
    return tuple(topic for key in ("in", "out") for topic in _topics(source.part(node, key), key == "in"))


def _topics(node: Node | None, given: bool) -> Iterator[RosTopic]:
    for name, entry in source.entries(node).items():
        about = entry.value
        written = about if isinstance(about, Scalar) else source.part(about, "type")
        if not isinstance(written, Scalar):
            continue
        qos = source.part(about, "qos")
        texts = {
            key: word.text
            for key in ("encoding", "frame-id", "rate")
            if isinstance(word := source.part(about, key), Scalar)
        }
        quality = {key: source.plain(e.value) for key, e in source.entries(qos).items()}
        yield RosTopic(
            name,
            entry.key,
            given,
            _SHORT.sub(r"\1/msg/\2", written.text) if _SHORT.fullmatch(written.text) else written.text,
            written.span,
            tuple(_words(source.part(about, "from" if given else "to"))),
            texts.get("encoding", ""),
            texts.get("frame-id", ""),
            quality.get("reliability", ""),
            quality.get("durability", ""),
            quality.get("depth", 10),
            float(quantity.convert(texts["rate"], "Hz")) if "rate" in texts else 0.0,
            {key: str(source.plain(e.value)) for key, e in source.entries(about, "fields").items()},
        )


def _words(node: Node | None) -> Iterator[Word]:
    for item in node.items if isinstance(node, source.Sequence) else (node,):
        if isinstance(item, Scalar):
            yield item.text, item.span


_GRAPH = {"ROS_LOCALHOST_ONLY": "0", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
_DOMAINS = 102
"""Domains whose ports lie below those that Linux gives programs."""


def variables(cid: int, *, own_network: bool) -> tuple[dict[str, str], dict[str, str]]:
    """Environment variables of all nodes of a test: those that it sets, and those that a service may set otherwise.

    On the host's network, tests have domains of their own.
    """
    return {**_GRAPH, "ROS_DOMAIN_ID": "0" if own_network else str(cid % _DOMAINS)}, dict(NODE_ENVIRONMENT)


def bridge() -> source.Mapping:
    """The bridge as a service of a compose file; a test gives it its topics."""
    node, problems = source.parse(_NODE, BRIDGE)
    assert isinstance(node, source.Mapping), problems
    return node
