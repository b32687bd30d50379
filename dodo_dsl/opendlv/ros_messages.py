"""Messages of ROS 2 from those of the bus, and back: both directions by the same tables of fields.

``given`` makes the fields of a ROS message that an application gets, ``sent`` the messages that one of its own becomes.
"""

import functools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dodo_dsl.opendlv import ros_fields as ros
from dodo_dsl.opendlv.attitude import heading_of, quaternion
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.ros_codec import Codec, Fields, RosTypeError, require_ros
from dodo_dsl.opendlv.ros_pictures import PICTURES, CameraPicture, encoding_of, picture_fields
from dodo_dsl.opendlv.ros_types import CLOCK_TYPE, NUMBERS, POSE_ESTIMATE, CameraView, StaticFrame, Topic

__all__ = ["BusMessage", "CameraPicture", "RosTypeError", "Types", "messages_of", "require_ros", "stamp_of", "time_of"]

MICROSECONDS = 1_000_000
_BOX, _PROPERTY, _CLASS = (f"opendlv.logic.perception.Detection{name}" for name in ("BoundingBox", "Property", "Type"))
_DECIMAL = ("float", "double")
_LATEST = 2**31 * MICROSECONDS


class BusMessage(NamedTuple):
    """A message for the bus: its full name, sender stamp, sample time in us and fields."""

    name: str
    stamp: int
    sample_time: int
    fields: Fields


class Types(Codec):
    """The codec of ROS' messages with their conversion; ``messages`` are those of the bus.

    All methods raise RosTypeError.
    """

    def __init__(self, own_files: Sequence[Path] = (), messages: MessageSet | None = None) -> None:
        super().__init__(own_files)
        self.messages = messages or MessageSet.standard()

    def check(self, topic: Topic) -> None:
        """Raises RosTypeError for a topic whose type, messages, fields or paths there are not."""
        self.fields(topic.type)
        if topic.type in PICTURES:
            encoding_of(topic)
        if topic.type in (*PICTURES, ros.CAMERA_INFO, CLOCK_TYPE):
            return
        used: set[str] = set()
        for name, _ in messages_of(topic):
            for field, path in self._paths(topic, name).items():
                self.check_path(topic.type, path)
                used.add(field)
        if topic.type != ros.DETECTIONS and (left := topic.fields.keys() - used):
            raise RosTypeError(f"{topic.topic}: no message of {', '.join(topic.bus)} has the field '{min(left)}'")

    def given(
        self, topic: Topic, messages: Mapping[str, Any], time_us: int, picture: CameraPicture | None = None
    ) -> Fields:
        """The fields of a topic's message, made of the newest messages of the bus by their full names, or a picture.

        ``time_us`` is the sample time, and becomes the stamp.
        """
        if topic.type == CLOCK_TYPE:
            return {"clock": stamp_of(time_us)}
        if topic.type in (*PICTURES, ros.CAMERA_INFO):
            return self.given_header(topic, time_us) | picture_fields(topic, picture)
        fields = _copied(ros.CONSTANTS.get(topic.type, {})) | self.given_header(topic, time_us)
        names = [name for name, _ in messages_of(topic)]
        for name in names:
            if name not in messages:
                raise RosTypeError(f"{topic.topic} is made of {' and '.join(names)}: there is no {name} yet")
            for field, path in self._paths(topic, name).items():
                _put(fields, path, _to_ros(name, field, getattr(messages[name], field)))
        return _completed(topic, fields, names)

    def sent(self, topic: Topic, fields: Mapping[str, Any], received_us: int) -> list[BusMessage]:
        """The messages that a ROS message becomes, with the time of its stamp, or of receipt where it has none."""
        time = time_of(fields) if self.has_header(topic.type) else 0
        time = time or received_us
        if topic.type == ros.DETECTIONS:
            return list(_detections(topic, fields, time))
        unknown = _not_measured(topic, fields)
        bus = ((name, stamp) for name, stamp in messages_of(topic) if name not in unknown)
        return [BusMessage(name, stamp, time, self._values(topic, name, fields)) for name, stamp in bus]

    def frames(self, frames: Sequence[StaticFrame], time_us: int) -> Fields:
        """The message of ``/tf_static``."""
        transforms = []
        for frame in frames:
            turn = zip("xyzw", quaternion(frame.roll, frame.pitch, frame.yaw), strict=True)
            place = {"x": frame.x, "y": frame.y, "z": frame.z}
            header = {"stamp": stamp_of(time_us), "frame_id": frame.parent}
            transform = {"translation": place, "rotation": dict(turn)}
            transforms.append({"header": header, "child_frame_id": frame.child, "transform": transform})
        return {"transforms": transforms}

    def given_header(self, topic: Topic, time_us: int) -> Fields:
        """The field ``header``, where the type has one."""
        if not self.has_header(topic.type):
            return {}
        frame_id = topic.frame_id or ros.FRAME_IDS.get(topic.type, "")
        return {"header": {"stamp": stamp_of(time_us), "frame_id": frame_id}}

    def _paths(self, topic: Topic, name: str) -> Mapping[str, str]:
        """The path of each field of a message in the topic's type, those that the topic names before the default ones.

        A type of one number needs no path where the message has one field.
        """
        try:
            known = self.messages.type(name).DESCRIPTOR.fields_by_name
        except MessageError as error:
            raise RosTypeError(f"{topic.topic}: {error}") from None
        own = {field: path for field, path in topic.fields.items() if field in known}
        if topic.type in NUMBERS and not own:
            if len(known) != 1:
                raise RosTypeError(f"{topic.topic}: {name} has {len(known)} fields, expected 'fields' to say which")
            return dict.fromkeys(known, "data")
        return {**ros.PATHS.get((topic.type, name), {}), **own}

    def _values(self, topic: Topic, name: str, fields: Mapping[str, Any]) -> Fields:
        paths = self._paths(topic, name)
        if not paths:
            raise RosTypeError(f"{topic.topic}: {topic.type} does not become {name} by itself, name its 'fields'")
        types = {each.name: each.type for each in self.messages.layout(name).definition.fields}
        found: Fields = {}
        for field, path in paths.items():
            value = functools.reduce(operator.getitem, path.split("."), fields)
            found[field] = _of_ros(name, field, types[field], value, f"{path} of {topic.topic}")
        return _unit(found, topic) if name == POSE_ESTIMATE else found


def stamp_of(time_us: int) -> dict[str, int]:
    """A time in us as ROS has it."""
    if not 0 <= time_us < _LATEST:
        raise RosTypeError(f"{time_us} us is not a time of ROS, expected 1970 to 2038")
    seconds, rest = divmod(time_us, MICROSECONDS)
    return {"sec": seconds, "nanosec": rest * 1000}


def time_of(fields: Mapping[str, Any]) -> int:
    """The stamp in us of a message with a header; 0 for none."""
    stamp = fields["header"]["stamp"]
    return int(stamp["sec"]) * MICROSECONDS + int(stamp["nanosec"]) // 1000


def messages_of(topic: Topic) -> Iterator[tuple[str, int]]:
    """The names and sender stamps of a topic's messages."""
    for each in topic.bus:
        name, _, stamp = each.partition("/")
        yield name, int(stamp or 0)


def _copied(constants: Mapping[str, Any]) -> Fields:
    return {name: _copied(each) if isinstance(each, Mapping) else each for name, each in constants.items()}


def _put(fields: Fields, path: str, value: Any) -> None:
    *above, last = path.split(".")
    for name in above:
        fields = fields.setdefault(name, {})
    fields[last] = value


def _to_ros(name: str, field: str, value: Any) -> Any:
    if (name, field) == (ros.SCAN, "ranges"):
        if len(value) % 4:
            raise RosTypeError(f"{name}.{field} has {len(value)} bytes, expected 4 for each range")
        return np.frombuffer(value, "<f4")
    _refuse_not_finite(name, field, value, f"{name}.{field}")
    if (name, field) == (ros.ODOMETRY, "yaw"):
        return dict(zip("xyzw", quaternion(0.0, 0.0, value), strict=True))
    return value


def _of_ros(name: str, field: str, type_: str, value: Any, place: str) -> Any:
    if (name, field) == (ros.SCAN, "ranges"):
        return np.asarray(value, "<f4").tobytes()
    if (name, field) == (ros.ODOMETRY, "yaw"):
        heading = heading_of(*(value[axis] for axis in "xyzw"))
        if heading is None:
            raise RosTypeError(f"{place} is not an attitude: its length is 0, or not finite")
        return heading
    if (name, field) == (ros.GEOLOCATION, "altitude") and math.isnan(value):
        return 0.0
    _refuse_not_finite(name, field, value, place)
    is_text = type_ == "string"
    if is_text != isinstance(value, str) or (not is_text and type_ not in _DECIMAL and value != int(value)):
        raise RosTypeError(f"{place} is {value!r:.60}, and {name}.{field} is {type_}")
    return value if is_text else float(value) if type_ in _DECIMAL else int(value)


def _refuse_not_finite(name: str, field: str, value: Any, place: str) -> None:
    if not isinstance(value, float | np.floating) or math.isfinite(value):
        return
    if math.isnan(value) or (name, field) not in ros.MAY_BE_INFINITE:
        raise RosTypeError(f"{place} is {value}, not a finite number")


def _completed(topic: Topic, fields: Fields, names: Sequence[str]) -> Fields:
    if topic.type == ros.LASER_SCAN and "ranges" in fields:
        last = max(len(fields["ranges"]) - 1, 0)
        fields["angle_max"] = fields["angle_min"] + fields["angle_increment"] * last
        fields["scan_time"] = 1 / topic.rate if topic.rate else 0.0
    for name, covariance in _COVARIANCES.items():
        if topic.type == ros.IMU and name not in names:
            fields[covariance] = ros.UNKNOWN
    return fields


_COVARIANCES = {ros.ANGULAR: "angular_velocity_covariance", ros.ACCELERATION: "linear_acceleration_covariance"}


def _not_measured(topic: Topic, fields: Mapping[str, Any]) -> list[str]:
    """The messages of which an Imu has nothing, as its covariances say."""
    return [name for name, each in _COVARIANCES.items() if topic.type == ros.IMU and fields[each][0] == -1]


def _unit(found: Fields, topic: Topic) -> Fields:
    """An estimate with a quaternion of length 1."""
    length = math.hypot(*(found[f"q{axis}"] for axis in "xyzw"))
    if not length:
        raise RosTypeError(f"the orientation of {topic.topic} is 0, expected a unit quaternion")
    return found if abs(length - 1) < 1e-6 else found | {f"q{axis}": found[f"q{axis}"] / length for axis in "xyzw"}


def _detections(topic: Topic, fields: Mapping[str, Any], time: int) -> Iterator[BusMessage]:
    """Boxes as fractions of the picture, and classes: a whole number is a DetectionType, a name a DetectionProperty."""
    if topic.camera is None or not topic.camera.width * topic.camera.height:
        raise RosTypeError(f"{topic.topic} needs its camera's size: boxes are in pixels")
    stamps = dict(messages_of(topic))
    for number, each in enumerate(fields["detections"]):
        place = f"detections[{number}] of {topic.topic}"
        common = {"sampleId": 0, "detectionId": number}
        if _BOX in stamps:
            yield BusMessage(_BOX, stamps[_BOX], time, common | _box(each["bbox"], topic.camera, place))
        best = max(each["results"], key=lambda result: float(result["hypothesis"]["score"]), default=None)
        label = best["hypothesis"]["class_id"] if best else ""
        if label.isascii() and label.isdigit() and int(label) < 2**32 and _CLASS in stamps:
            yield BusMessage(_CLASS, stamps[_CLASS], time, common | {"type": int(label)})
        elif label and _PROPERTY in stamps:
            yield BusMessage(_PROPERTY, stamps[_PROPERTY], time, common | {"property": label})


def _box(box: Mapping[str, Any], camera: CameraView, place: str) -> Fields:
    """The upright box around one that may be turned."""
    center = box["center"]["position"]
    angle, size_x, size_y = box["center"]["theta"], box["size_x"], box["size_y"]
    if not all(map(math.isfinite, (center["x"], center["y"], angle, size_x, size_y))):
        raise RosTypeError(f"{place} has a box that is not finite")
    cosine, sine = abs(math.cos(angle)), abs(math.sin(angle))
    width, height = size_x * cosine + size_y * sine, size_x * sine + size_y * cosine
    return {
        "x": (center["x"] - width / 2) / camera.width,
        "y": (center["y"] - height / 2) / camera.height,
        "width": width / camera.width,
        "height": height / camera.height,
    }
