"""A recording as an MCAP file, in protobuf: a topic for each message and sender stamp, and Foxglove's where they fit.

Camera frames become CompressedVideo (H.264 and VP9) or CompressedImage (JPEG) with the same bytes, and poses
FrameTransform, if they have the fields of message set 1.0 or 0.9.
Reference: docs.foxglove.dev, "Message schemas"; mcap.dev, "MCAP File Format", and its registry on the encoding
``protobuf``.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from dodo_dsl import __version__
from dodo_dsl.opendlv import message_versions
from dodo_dsl.opendlv.attitude import quaternion
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.protobuf_classes import Layout
from dodo_dsl.opendlv.recording import Recording

Convert = Callable[[Any, int, int], tuple[str, Message] | None]
"""Topic and message for a message, its sender stamp and its time in us, or None."""

WORLD = "world"
_VIDEO = {"h264": "h264", "H264": "h264", "VP90": "vp9"}
_IMAGE = {"mjpg": "jpeg", "MJPG": "jpeg"}


def _picture(message: Any, stamp: int, time: int) -> tuple[str, Message] | None:
    format_, _, _, data, *_ = (getattr(message, field.name) for field in message.DESCRIPTOR.fields)
    common = {"timestamp": _timestamp(time), "frame_id": f"camera-{stamp}", "data": data}
    if data and format_ in _VIDEO:
        return f"/camera/{stamp}", CompressedVideo(format=_VIDEO[format_], **common)
    if data and format_ in _IMAGE:
        return f"/picture/{stamp}", CompressedImage(format=_IMAGE[format_], **common)
    return None


def _pose(message: Any, stamp: int, time: int) -> tuple[str, Message] | None:
    return _transform(message, (message.qx, message.qy, message.qz, message.qw), stamp, time)


def _pose_of_angles(message: Any, stamp: int, time: int) -> tuple[str, Message] | None:
    """Set 0.9 has roll, pitch and yaw in rad, turned about x, y and z in this order."""
    angles = message.roll, message.pitch, message.yaw
    return _transform(message, quaternion(*angles), stamp, time) if all(map(math.isfinite, angles)) else None


def _transform(message: Any, rotation: tuple[float, ...], stamp: int, time: int) -> tuple[str, Message] | None:
    if not all(map(math.isfinite, (message.x, message.y, message.z, *rotation))):
        return None
    found = FrameTransform(timestamp=_timestamp(time), parent_frame_id=WORLD, child_frame_id=f"frame-{stamp}")
    found.translation.x, found.translation.y, found.translation.z = message.x, message.y, message.z
    x, y, z, w = rotation if any(rotation) else (0.0, 0.0, 0.0, 1.0)
    found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w = x, y, z, w
    return "/tf", found


def _timestamp(time: int) -> Timestamp:
    seconds, microseconds = divmod(max(time, 0), 1_000_000)
    return Timestamp(seconds=seconds, nanos=microseconds * 1000)


def converter(layout: Layout) -> Convert | None:
    """What makes a message of Foxglove of those of a layout; None if there is none."""
    name = layout.definition.name
    for version, pose in ((message_versions.NEW, _pose), (message_versions.OLD, _pose_of_angles)):
        convert = {"opendlv.proxy.ImageReading": _picture, "opendlv.sim.Frame": pose}.get(name)
        if convert and message_versions.load(version).layout(name).definition.same_layout(layout.definition):
            return convert
    return None


@dataclass
class McapCounts:
    """OpenDLV messages, those in schemas of Foxglove beside them, and payloads that are none by id."""

    messages: int = 0
    converted: int = 0
    undecodable: Counter[int] = field(default_factory=Counter)


def write_mcap(recording: Recording, messages: MessageSet, rows: Numbers, place: Path) -> McapCounts:
    """Write the known messages among ``rows`` in the order of their times.

    The log time is the sample time, or if that is zero when the message was received, or else sent; the publish
    time is when it was sent. Times before 1970 become 1970. Memory is bounded by what ``Recording.batches`` holds and
    the file's index. Raises OSError and RecordingError.
    """
    result = McapCounts()
    ordered = rows[recording.index["time"][rows].argsort(kind="stable")]
    with place.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library=f"DoDo {__version__}")
        channels = _Channels(writer, messages)
        for envelope in recording.envelopes(ordered):
            _write_one(channels, envelope, result)
        writer.finish()  # type: ignore[no-untyped-call]
    return result


def topic(message: str, sender_stamp: int) -> str:
    """``/opendlv/proxy/DistanceReading/0``: with slashes, as a dot begins a field in the paths of Foxglove."""
    return f"/{message.replace('.', '/')}/{sender_stamp}"


def _write_one(channels: "_Channels", envelope: Envelope, result: McapCounts) -> None:
    id_, stamp = envelope.data_type, envelope.sender_stamp
    time = envelope.sample_time or envelope.received or envelope.sent
    try:
        message = channels.messages.decode(id_, envelope.payload)
        payload = channels.messages.encode(message)
    except MessageError:
        result.undecodable[id_] += 1
        return
    channels.add(topic(channels.messages.name(id_), stamp), message, payload, time, envelope.sent)
    result.messages += 1
    convert = channels.converter(id_)
    found = convert(message, stamp, time) if convert else None
    if found is not None:
        channels.add(*found, found[1].SerializeToString(), time, envelope.sent)
        result.converted += 1


class _Channels:
    """The topics and schemas of a file, each registered when it is first needed."""

    def __init__(self, writer: Writer, messages: MessageSet) -> None:
        self.messages = messages
        self._writer = writer
        self._channels: dict[str, int] = {}
        self._schemas: dict[Any, int] = {}
        self._converters: dict[int, Convert | None] = {}

    def converter(self, id_: int) -> Convert | None:
        """What makes a message of Foxglove of one with this id."""
        if id_ not in self._converters:
            self._converters[id_] = converter(self.messages.layout(id_))
        return self._converters[id_]

    def add(self, topic: str, message: Message, payload: bytes, time: int, sent: int) -> None:
        """A message on a topic; times in us since the epoch."""
        if topic not in self._channels:
            type_ = type(message)
            if type_ not in self._schemas:
                self._schemas[type_] = register_schema(self._writer, type_)
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", self._schemas[type_])
        log_time, publish_time = (max(each, 0) * 1000 for each in (time, sent))
        self._writer.add_message(self._channels[topic], log_time, payload, publish_time)
