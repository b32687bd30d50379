"""The application's ROS graph by DDS: writers and readers of raw CDR, and what discovery says of others.

ROS 2's names on DDS: a topic ``/camera`` is ``rt/camera``, a type ``a/msg/B`` is ``a::msg::dds_::B_``. Cyclone takes a
type by its name alone, so that bytes pass as they are. ``ros_discovery_info`` says which node has which endpoints.
"""

import os
import struct
from collections.abc import Iterator
from typing import Any

from cyclonedds._clayer import ddspy_take, ddspy_write  # type: ignore[import-not-found]
from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import (
    DDSException,
    DDSStatus,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from services.ros_bridge.discovered import Discovered, Endpoint

MAX_SAMPLE_BYTES = 64 << 20
_DOMAIN_VARIABLE = "ROS_DOMAIN_ID"
_DOMAINS = range(233)
_EPROSIMA = "1.15"
# Fragments of a whole datagram, heartbeats soon after a lost one, no type information of Fast DDS, which Cyclone cannot
# complete, and buffers that hold some pictures
_CONFIGURATION = f"""<CycloneDDS><Domain>
<General><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize></General>
<Internal><HeartbeatInterval min='1 ms' minsched='2 ms' max='4 ms'>2 ms</HeartbeatInterval>
<SocketReceiveBufferSize max='16MB'/><MaxSampleSize>{MAX_SAMPLE_BYTES}B</MaxSampleSize>
<Watermarks><WhcHigh>{MAX_SAMPLE_BYTES}B</WhcHigh></Watermarks></Internal>
<Compatibility><IgnoreTypeInformation>{_EPROSIMA}</IgnoreTypeInformation></Compatibility>
</Domain></CycloneDDS>"""
_NODES, _NODES_TYPE = "ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
_AT_ONCE = 100
_BLOCKED = duration(milliseconds=100)
_PREFIX_BYTES = 12  # of a GUID, the participant's
_GUID_BYTES = 16
_GID_BYTES = (16, 24)  # Humble has 24
_NODES_LIMIT = 1000


class GraphError(RuntimeError):
    """The graph cannot be joined."""


class Writer:
    """Publishes CDR on one topic."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer

    def write(self, data: bytes) -> bool:
        """False where a reliable reader takes nothing any more."""
        return bool(ddspy_write(self._writer._ref, data) == 0)

    @property
    def readers(self) -> int:
        """How many have matched."""
        return int(self._writer.get_publication_matched_status().current_count)


class Reader:
    """Takes CDR from one topic."""

    def __init__(self, reader: Any) -> None:
        self._reader = reader
        self.condition = ReadCondition(reader, _ANY)

    def take(self) -> list[bytes]:
        samples = ddspy_take(self._reader._ref, _ANY, _AT_ONCE)
        if isinstance(samples, int):
            return []
        return [sample[0] for sample in samples if isinstance(sample, tuple)]

    def close(self) -> None:
        self._reader = None


class Graph:
    """A participant of the domain in ``ROS_DOMAIN_ID``; raises GraphError."""

    def __init__(self) -> None:
        text = os.environ.get(_DOMAIN_VARIABLE) or "0"
        if not text.isascii() or not text.isdigit() or int(text) not in _DOMAINS:
            raise GraphError(f"{_DOMAIN_VARIABLE} is '{text}'; expected a whole number from 0 to {_DOMAINS[-1]}")
        os.environ.pop("CYCLONEDDS_URI", None)  # it is for the application's nodes
        try:
            self._domain = Domain(int(text), _CONFIGURATION)
            self._participant = DomainParticipant(int(text))
        except DDSException as error:
            raise GraphError(f"the ROS graph cannot be joined: {error} Is there a network with multicast?") from None
        self._own = self._participant.get_guid().bytes[:_PREFIX_BYTES]
        self._topics: dict[tuple[str, str], Any] = {}
        self._waits = WaitSet(self._participant)
        self._participants = self._discovery(BuiltinTopicDcpsParticipant)
        self._endpoints = {
            True: self._discovery(BuiltinTopicDcpsPublication),
            False: self._discovery(BuiltinTopicDcpsSubscription),
        }
        self._nodes = Reader(self._reader(_NODES, _NODES_TYPE, _qos(True, True, _AT_ONCE)))
        self._waits.attach(self._nodes.condition)

    def writer(
        self, topic: str, type_: str, *, reliable: bool = True, durable: bool = False, depth: int = 10
    ) -> Writer:
        """Of a ROS topic; ``durable`` gives a reader that comes late the last ones."""
        try:
            on = self._topic(f"rt{topic}", _dds_type(type_))
            writer: Any = DataWriter(self._participant, on, _qos(reliable, durable, depth))
            writer.set_status_mask(DDSStatus.PublicationMatched)
            self._waits.attach(writer)
        except DDSException as error:
            raise GraphError(f"{topic} cannot be published: {error}") from None
        return Writer(writer)

    def reader(
        self, topic: str, type_: str, *, reliable: bool = True, durable: bool = False, depth: int = 10
    ) -> Reader:
        """Of a ROS topic; one that is not ``reliable`` hears both kinds of writers."""
        try:
            reader = Reader(self._reader(f"rt{topic}", _dds_type(type_), _qos(reliable, durable, depth)))
        except DDSException as error:
            raise GraphError(f"{topic} cannot be heard: {error}") from None
        self._waits.attach(reader.condition)
        return reader

    def drop(self, reader: Reader) -> None:
        """Hears it no longer."""
        self._waits.detach(reader.condition)
        reader.close()

    def wait(self, seconds: float) -> None:
        """Until something is heard, discovered or matched, at most so long."""
        self._waits.wait(duration(seconds=seconds))

    def discover(self, seen: Discovered) -> None:
        """Tells what came and went since the last time."""
        for participant in _taken(self._participants):
            key = participant.key.bytes
            if key[:_PREFIX_BYTES] != self._own:
                seen.participant(key[:_PREFIX_BYTES], _is_alive(participant))
        for writes, reader in self._endpoints.items():
            for endpoint in _taken(reader):
                self._tell(seen, endpoint, writes)
        for raw in self._nodes.take():
            for participant_key, node, guids in nodes_of(raw):
                seen.named(participant_key, node, guids)

    def _tell(self, seen: Discovered, endpoint: Any, writes: bool) -> None:
        guid = endpoint.key.bytes
        if guid[:_PREFIX_BYTES] == self._own:
            return
        if not _is_alive(endpoint):
            seen.gone(guid)
            return
        qos: Qos = endpoint.qos
        name, type_ = endpoint.topic_name, endpoint.type_name
        seen.endpoint(
            Endpoint(
                guid=guid,
                participant=guid[:_PREFIX_BYTES],
                topic=name[2:] if name.startswith("rt/") else "",
                type=_ros_type(type_),
                writes=writes,
                reliable=isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable),
                durable=qos[Policy.Durability] not in (None, Policy.Durability.Volatile),
            )
        )

    def _discovery(self, topic: Any) -> BuiltinDataReader:
        reader = BuiltinDataReader(self._participant, topic)
        condition = ReadCondition(reader, _ANY)
        self._waits.attach(condition)
        return reader

    def _reader(self, topic: str, type_: str, qos: Qos) -> Any:
        return DataReader(self._participant, self._topic(topic, type_), qos)

    def _topic(self, name: str, type_: str) -> Any:
        if (name, type_) not in self._topics:
            kind = make_idl_struct(type_.rpartition("::")[2], type_, {"x": uint8})
            self._topics[name, type_] = Topic(self._participant, name, kind)
        return self._topics[name, type_]


def _qos(reliable: bool, durable: bool, depth: int) -> Qos:
    kind = Policy.Reliability.Reliable(_BLOCKED) if reliable else Policy.Reliability.BestEffort
    lasting = Policy.Durability.TransientLocal if durable else Policy.Durability.Volatile
    return Qos(kind, lasting, Policy.History.KeepLast(max(1, depth)))


def _taken(reader: BuiltinDataReader) -> Iterator[Any]:
    while samples := reader.take(_AT_ONCE):
        yield from samples


def _is_alive(sample: Any) -> bool:
    info = sample.sample_info
    return bool(info.valid_data and info.instance_state == InstanceState.Alive)


def _dds_type(type_: str) -> str:
    package, kind, name = type_.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def _ros_type(type_: str) -> str:
    parts = type_.split("::")
    if len(parts) == 4 and parts[2] == "dds_":
        return f"{parts[0]}/{parts[1]}/{parts[3].removesuffix('_')}"
    return type_


def nodes_of(raw: bytes) -> Iterator[tuple[bytes, str, list[bytes]]]:
    """Participant, node and GUIDs of its endpoints, from a ``ParticipantEntitiesInfo``; none of what is malformed."""
    for size in _GID_BYTES:
        try:
            yield from _Cdr(raw).nodes(size)
        except (struct.error, UnicodeDecodeError, ValueError):
            continue
        return


class _Cdr:
    """Reads CDR's strings, counts and bytes."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 4
        self._order = "<" if data[1:2] == b"\1" else ">"

    def nodes(self, gid: int) -> list[tuple[bytes, str, list[bytes]]]:
        participant = self.bytes(gid)[:_PREFIX_BYTES]
        found = []
        for _ in range(self.count()):
            space, name = self.text(), self.text()
            guids = [self.bytes(gid)[:_GUID_BYTES] for _ in range(2) for _ in range(self.count())]
            found.append((participant, f"{space.rstrip('/')}/{name}".removeprefix("/"), guids))
        if len(self._data) - self._at >= 4:
            raise ValueError
        return found

    def count(self) -> int:
        self._at += -self._at % 4
        (value,) = struct.unpack_from(f"{self._order}I", self._data, self._at)
        self._at += 4
        if value > _NODES_LIMIT:
            raise ValueError
        return int(value)

    def text(self) -> str:
        return self.bytes(self.count()).rstrip(b"\0").decode()

    def bytes(self, size: int) -> bytes:
        piece = self._data[self._at : self._at + size]
        if len(piece) < size:
            raise ValueError
        self._at += size
        return piece
