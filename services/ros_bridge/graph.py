"""The application's ROS graph by DDS: writers and readers of raw CDR, and discovery.

On DDS a topic ``/camera`` is ``rt/camera``, a type ``a/msg/B`` is ``a::msg::dds_::B_``. Cyclone takes a type by its
name alone, so that bytes pass as they are. ``ros_discovery_info`` says which node has which endpoints.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from cyclonedds import builtin
from cyclonedds._clayer import ddspy_take, ddspy_write  # type: ignore[import-not-found]
from cyclonedds.core import DDSException, DDSStatus, InstanceState, Policy, Qos, ReadCondition, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from dodo_dsl.opendlv.ros_codec import RosTypeError
from dodo_dsl.opendlv.ros_messages import Types

# Fragments of a whole datagram, heartbeats soon after a lost one, buffers that hold some pictures, and no type
# information of Fast DDS (vendor 1.15), which Cyclone cannot complete
_CONFIGURATION = """<CycloneDDS><Domain>
<General><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize></General>
<Internal><HeartbeatInterval min='1 ms' minsched='2 ms' max='4 ms'>2 ms</HeartbeatInterval>
<SocketReceiveBufferSize max='16MB'/><MaxSampleSize>64MB</MaxSampleSize>
<Watermarks><WhcHigh>64MB</WhcHigh></Watermarks></Internal>
<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>
</Domain></CycloneDDS>"""
_NODES, _NODES_TYPE = "ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo"
_ANY = 0x7F  # samples, whatever their state
_DISCOVERED = (
    builtin.BuiltinTopicDcpsParticipant,
    builtin.BuiltinTopicDcpsPublication,
    builtin.BuiltinTopicDcpsSubscription,
)
_AT_ONCE, _MOST = 100, 10_000
PREFIX_BYTES = 12  # of a GUID: the participant's


class BridgeError(ValueError):
    """What ends the bridge, in one sentence."""


@dataclass(frozen=True)
class Endpoint:
    """A publisher or a subscription; ``topic`` is ROS' name, empty where it is none, as of services."""

    guid: bytes
    topic: str
    type: str
    writes: bool
    reliable: bool = True
    durable: bool = False

    def lacks(self, reader: "Endpoint") -> str:
        """Which quality a subscription of this publisher's topic wants and does not get."""
        if reader.reliable and not self.reliable:
            return "reliability"
        return "durability" if reader.durable and not self.durable else ""


@dataclass
class Discovered:
    """What was discovered, at most so much; ``nodes`` by their participants, also of those that have ``left``."""

    endpoints: dict[bytes, Endpoint] = field(default_factory=dict)
    names: dict[bytes, str] = field(default_factory=dict)
    nodes: dict[bytes, set[str]] = field(default_factory=dict)
    participants: set[bytes] = field(default_factory=set)
    left: set[bytes] = field(default_factory=set)
    changes: int = 0

    def add(self, endpoint: Endpoint) -> None:
        if len(self.endpoints) < _MOST:
            self.endpoints[endpoint.guid] = endpoint

    def add_nodes(self, types: Types, data: bytes) -> None:
        try:
            fields = types.decode(_NODES_TYPE, data)
        except RosTypeError:
            return
        participant = bytes(fields["gid"]["data"])[:PREFIX_BYTES]
        for node in fields["node_entities_info_seq"]:
            if len(self.names) < _MOST:
                name = f"{node['node_namespace'].rstrip('/')}/{node['node_name']}".removeprefix("/")
                self.nodes.setdefault(participant, set()).add(name)
                gids = [*node["reader_gid_seq"], *node["writer_gid_seq"]]
                self.names.update((bytes(gid["data"]), name) for gid in gids[:_MOST])

    def of(self, topic: str, writes: bool) -> list[Endpoint]:
        return [each for each in self.endpoints.values() if each.topic == topic and each.writes == writes]

    def name(self, *ends: Endpoint) -> str:
        known = [self.names.get(e.guid) or min(self.nodes.get(e.guid[:PREFIX_BYTES], ()), default="") for e in ends]
        return listed({f"'{name}'" if name else "a program" for name in known}) or "a node"


def listed(names: Iterable[str]) -> str:
    *first, last = sorted(names) or [""]
    return f"{', '.join(first)} and {last}" if first else last


class Graph:
    """A participant of the domain in ``ROS_DOMAIN_ID``; raises BridgeError, as all of its methods."""

    def __init__(self, types: Types) -> None:
        os.environ.pop("CYCLONEDDS_URI", None)  # it is for the application's nodes
        domain = int(os.environ.get("ROS_DOMAIN_ID") or 0)
        self._types, self.seen = types, Discovered()
        try:
            self._domain = Domain(domain, _CONFIGURATION)
            self._participant = DomainParticipant(domain)
            self._waits = WaitSet(self._participant)
            self._discovery = [builtin.BuiltinDataReader(self._participant, kind) for kind in _DISCOVERED]
            for each in self._discovery:
                self._waits.attach(ReadCondition(each, _ANY))
        except DDSException as error:
            raise BridgeError(f"the ROS graph cannot be joined: {error} Is there a network with multicast?") from None
        self._own = self._participant.get_guid().bytes[:PREFIX_BYTES]
        self._nodes = self.reader(Endpoint(b"", _NODES, _NODES_TYPE, False, durable=True), _AT_ONCE)

    def writer(self, own: Endpoint, depth: int) -> Any:
        writer = self._made(DataWriter, own, depth)
        writer.set_status_mask(DDSStatus.PublicationMatched)
        self._waits.attach(writer)
        return writer

    def reader(self, own: Endpoint, depth: int) -> Any:
        """One that is not reliable hears both kinds of writers."""
        reader = self._made(DataReader, own, depth)
        reader.condition = ReadCondition(reader, _ANY)
        self._waits.attach(reader.condition)
        return reader

    def drop(self, reader: Any) -> None:
        self._waits.detach(reader.condition)
        del reader.condition  # which holds its last reference

    def wait(self, seconds: float) -> None:
        """Until something is heard, discovered or matched, at most so long; then ``seen`` has what came and went."""
        self._waits.wait(duration(seconds=seconds))
        for number, source in enumerate(self._discovery):
            for each, is_alive in self._taken(source):
                key = each.key.bytes
                if number == 0:
                    new, old = (self.seen.participants, self.seen.left)[:: 1 if is_alive else -1]
                    new.add(key[:PREFIX_BYTES])
                    old.discard(key[:PREFIX_BYTES])
                elif is_alive:
                    self.seen.add(_endpoint(each, writes=number == 1))
                else:
                    self.seen.endpoints.pop(key, None)
        for data in taken(self._nodes):
            self.seen.add_nodes(self._types, data)
            self.seen.changes += 1

    def _taken(self, source: builtin.BuiltinDataReader) -> Iterator[tuple[Any, bool]]:
        while samples := source.take(_AT_ONCE):
            for each in samples:
                if each.key.bytes[:PREFIX_BYTES] != self._own:
                    is_alive = each.sample_info.valid_data and each.sample_info.instance_state == InstanceState.Alive
                    self.seen.changes += 1
                    yield each, is_alive

    def _made(self, kind: Any, own: Endpoint, depth: int) -> Any:
        package, folder, name = own.type.split("/")
        shape = make_idl_struct(f"{name}_", f"{package}::{folder}::dds_::{name}_", {"x": uint8})
        kept, sure, lasting = Policy.History.KeepLast(depth), Policy.Reliability, Policy.Durability
        how = sure.Reliable(duration(milliseconds=100)) if own.reliable else sure.BestEffort
        qos = Qos(how, lasting.TransientLocal if own.durable else lasting.Volatile, kept)
        try:
            on: Any = Topic(self._participant, f"rt{own.topic}" if own.topic != _NODES else _NODES, shape)
            return kind(self._participant, on, qos)
        except DDSException as error:
            raise BridgeError(f"{own.topic} ({own.type}) cannot be joined: {error}") from None


def write(writer: Any, data: bytes) -> bool:
    """False where a reliable reader takes nothing any more."""
    return bool(ddspy_write(writer._ref, data) == 0)


def taken(reader: Any) -> list[bytes]:
    samples = ddspy_take(reader._ref, _ANY, _AT_ONCE)
    return [] if isinstance(samples, int) else [data for data, info in samples if info.valid_data]


def _endpoint(sample: Any, writes: bool) -> Endpoint:
    name, parts, qos = sample.topic_name, sample.type_name.split("::"), sample.qos
    is_ros = len(parts) == 4 and parts[2] == "dds_"
    type_ = f"{parts[0]}/{parts[1]}/{parts[3].removesuffix('_')}" if is_ros else sample.type_name
    reliable = isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable)
    durable = qos[Policy.Durability] not in (None, Policy.Durability.Volatile)
    return Endpoint(sample.key.bytes, name[2:] if name.startswith("rt/") else "", type_, writes, reliable, durable)
