"""OpenDLV messages in the schemas of Foxglove, where those have a place for them.

Camera frames become CompressedVideo (H.264 and VP9) or CompressedImage (JPEG) with the same bytes, poses
FrameTransform and log messages Log. Only messages with the fields of message set 1.0 or 0.9 do.
Reference: docs.foxglove.dev, "Message schemas".
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from dodo_dsl.opendlv.messages import versions
from dodo_dsl.opendlv.messages.protobuf_classes import Layout

Convert = Callable[[Any, int, int], tuple[str, Message] | None]
"""Topic and message for a message, its sender stamp and its time in us, or None."""

WORLD = "world"
_VIDEO = {"h264": "h264", "H264": "h264", "VP90": "vp9"}
_IMAGE = {"mjpg": "jpeg", "MJPG": "jpeg"}
_LEVELS = (Log.FATAL, Log.FATAL, Log.FATAL, Log.ERROR, Log.WARNING, Log.INFO, Log.INFO, Log.DEBUG)
"""By the levels of syslog (RFC 5424, table 2)."""


def converter(layout: Layout) -> Convert | None:
    """What makes a message of Foxglove of those of a layout; None where there is none."""
    for version, converters in _CONVERTERS.items():
        convert = converters.get(layout.definition.name)
        if convert and versions.load(version).layout(layout.definition.name).definition.same_layout(layout.definition):
            return convert
    return None


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
    angles = message.roll / 2, message.pitch / 2, message.yaw / 2
    if not all(map(math.isfinite, angles)):
        return None
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, angles), map(math.sin, angles)
    rotation = (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
    return _transform(message, rotation, stamp, time)


def _transform(message: Any, rotation: tuple[float, ...], stamp: int, time: int) -> tuple[str, Message] | None:
    if not all(map(math.isfinite, (message.x, message.y, message.z, *rotation))):
        return None
    found = FrameTransform(timestamp=_timestamp(time), parent_frame_id=WORLD, child_frame_id=f"frame-{stamp}")
    found.translation.x, found.translation.y, found.translation.z = message.x, message.y, message.z
    x, y, z, w = rotation if any(rotation) else (0.0, 0.0, 0.0, 1.0)
    found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w = x, y, z, w
    return "/tf", found


def _log(message: Any, stamp: int, time: int) -> tuple[str, Message] | None:
    level = _LEVELS[message.level] if message.level < len(_LEVELS) else Log.UNKNOWN
    return "/log", Log(timestamp=_timestamp(time), level=level, message=message.description, name=f"sender {stamp}")


def _timestamp(time: int) -> Timestamp:
    seconds, microseconds = divmod(max(time, 0), 1_000_000)
    return Timestamp(seconds=seconds, nanos=microseconds * 1000)


_CONVERTERS: Mapping[str, Mapping[str, Convert]] = {
    versions.NEW: {
        "opendlv.proxy.ImageReading": _picture,
        "opendlv.sim.Frame": _pose,
        "opendlv.system.LogMessage": _log,
    },
    versions.OLD: {"opendlv.proxy.ImageReading": _picture, "opendlv.sim.Frame": _pose_of_angles},
}
