"""Messages of ROS 2 from those of the bus, and back: both directions by the same tables of fields.

``given`` makes the fields of a ROS message that an application gets, ``sent`` the messages that one of its own becomes.
"""

import copy
import functools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dodo_dsl.opendlv import ros_types as ros
from dodo_dsl.opendlv.attitude import heading_of, quaternion
from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.ros_codec import Codec, Fields, RosTypeError
from dodo_dsl.opendlv.ros_fields import CONSTANTS, PATHS
from dodo_dsl.opendlv.ros_pictures import PICTURES, CameraPicture, encoding_of, picture_fields
from dodo_dsl.opendlv.ros_types import StaticFrame, Topic


class BusMessage(NamedTuple):
    message: Any
    sample_time: int
    stamp: int


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
        if topic.type in (*PICTURES, ros.CAMERA_INFO, ros.DETECTIONS):
            return
        used: set[str] = set()
        for name, _ in messages_of(topic):
            if not (paths := self._paths(topic, name)):
                raise RosTypeError(f"{topic.topic}: {topic.type} says nothing of {name} by itself, name its 'fields'")
            for path in paths.values():
                self.check_path(topic.type, path)
            used |= paths.keys()
        if left := topic.fields.keys() - used:
            raise RosTypeError(f"{topic.topic}: no message of {', '.join(topic.bus)} has the field '{min(left)}'")

    def given(
        self, topic: Topic, messages: Mapping[str, Any], time_us: int, picture: CameraPicture | None = None
    ) -> Fields:
        """The fields of a topic's message, made of the newest messages of the bus by their full names, or a picture.

        ``time_us`` is the sample time, and becomes the stamp. Of detections there are lists of messages.
        """
        fields = copy.deepcopy(dict(CONSTANTS.get(topic.type, {}))) | self.given_header(topic, time_us)
        if topic.type in (*PICTURES, ros.CAMERA_INFO):
            return fields | picture_fields(topic, picture)
        if topic.type == ros.DETECTIONS:
            return fields | {"detections": list(_given_detections(topic, messages))}
        for name, _ in messages_of(topic):
            if name not in messages:
                raise RosTypeError(f"{topic.topic} is made of {name}, too: there is none yet")
            for field, path in self._paths(topic, name).items():
                *above, last = path.split(".")
                inner = functools.reduce(lambda at, part: at.setdefault(part, {}), above, fields)
                inner[last] = _to_ros(path, getattr(messages[name], field))
        if topic.type == ros.LASER_SCAN and "ranges" in fields:
            count = max(len(fields["ranges"]) - 1, 0)
            fields["angle_max"] = fields["angle_min"] + fields["angle_increment"] * count
        return fields

    def sent(self, topic: Topic, fields: Mapping[str, Any], received_us: int) -> list[BusMessage]:
        """The messages that a ROS message becomes, with the time of its stamp, or of receipt where it has none."""
        time = (time_of(fields) if self.has_header(topic.type) else 0) or received_us
        stamps = dict(messages_of(topic))
        if topic.type == ros.DETECTIONS:
            made = _sent_detections(topic, fields["detections"], stamps)
            return [BusMessage(self.messages.type(name)(**values), time, stamps[name]) for name, values in made]
        return [BusMessage(self._message(topic, name, fields), time, stamp) for name, stamp in stamps.items()]

    def frames(self, frames: Sequence[StaticFrame], time_us: int) -> Fields:
        transforms = []
        for frame in frames:
            turn = zip("xyzw", quaternion(frame.roll, frame.pitch, frame.yaw), strict=True)
            place = {"x": frame.x, "y": frame.y, "z": frame.z}
            header = {"stamp": stamp_of(time_us), "frame_id": frame.parent}
            transform = {"translation": place, "rotation": dict(turn)}
            transforms.append({"header": header, "child_frame_id": frame.child, "transform": transform})
        return {"transforms": transforms}

    def given_header(self, topic: Topic, time_us: int) -> Fields:
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
        if topic.type in ros.NUMBERS and not own:
            if len(known) != 1:
                raise RosTypeError(f"{topic.topic}: {name} has {len(known)} fields, expected 'fields' to say which")
            return dict.fromkeys(known, "data")
        return {**PATHS.get((topic.type, name), {}), **own}

    def _message(self, topic: Topic, name: str, fields: Mapping[str, Any]) -> Any:
        message = self.messages.type(name)()
        types = {each.name: each.type for each in self.messages.layout(name).definition.fields}
        for field, path in self._paths(topic, name).items():
            found = functools.reduce(operator.getitem, path.split("."), fields)
            is_judged = name == ros.POSE_ESTIMATE  # by its evaluator, also where it is not a number
            value = found if is_judged else _of_ros(path, found)
            if isinstance(value, bool | float) and types[field] not in ("float", "double") and value % 1 == 0:
                value = int(value)
            try:
                setattr(message, field, value)
            except (TypeError, ValueError):
                known = f"{name}.{field} ({types[field]})"
                raise RosTypeError(f"{path} of {topic.topic} is {found!r:.60}, which {known} cannot be") from None
        return message


def stamp_of(time_us: int) -> dict[str, int]:
    seconds, rest = divmod(time_us, MICROSECONDS)
    return {"sec": seconds, "nanosec": rest * 1000}


def time_of(fields: Mapping[str, Any]) -> int:
    """The stamp in us of a message with a header; 0 for none."""
    stamp = fields["header"]["stamp"]
    return int(stamp["sec"]) * MICROSECONDS + int(stamp["nanosec"]) // 1000


def messages_of(topic: Topic) -> Iterator[tuple[str, int]]:
    for each in topic.bus:
        name, _, stamp = each.partition("/")
        yield name, int(stamp or 0)


def _to_ros(path: str, value: Any) -> Any:
    if path == "pose.pose.orientation":
        return dict(zip("xyzw", quaternion(0.0, 0.0, value), strict=True))
    return np.frombuffer(value, "<f4") if isinstance(value, bytes) else value


def _of_ros(path: str, value: Any) -> Any:
    if isinstance(value, dict) and value.keys() == set("xyzw"):
        return heading_of(*(value[axis] for axis in "xyzw"))
    if isinstance(value, np.ndarray):
        return value.astype("<f4").tobytes()
    if isinstance(value, float) and math.isnan(value):
        return 0.0 if path == "altitude" else None
    return value


def _given_detections(topic: Topic, messages: Mapping[str, Any]) -> Iterator[Fields]:
    """Boxes in pixels with their class; its score is 1, as the bus has none."""
    width, height = _pixels(topic)
    labels = {each.detectionId: str(each.type) for each in messages.get(ros.CLASS, ())}
    labels |= {each.detectionId: each.property for each in messages.get(ros.PROPERTY, ())}
    for box in messages.get(ros.BOX, ()):
        center = {"x": (box.x + box.width / 2) * width, "y": (box.y + box.height / 2) * height}
        bbox = {"center": {"position": center}, "size_x": box.width * width, "size_y": box.height * height}
        label = labels.get(box.detectionId)
        yield {"bbox": bbox, "results": [{"hypothesis": {"class_id": label, "score": 1.0}}] if label else []}


def _sent_detections(
    topic: Topic, detections: Sequence[Fields], wanted: Mapping[str, int]
) -> Iterator[tuple[str, Fields]]:
    """Boxes as fractions of the picture, and classes: a whole number is a DetectionType, a name a DetectionProperty."""
    width, height = _pixels(topic)
    best: Mapping[str, Any]
    for number, each in enumerate(detections):
        common, box, results = {"sampleId": 0, "detectionId": number}, each["bbox"], each["results"]
        center, angle = box["center"]["position"], box["center"]["theta"]
        cosine, sine = abs(math.cos(angle)), abs(math.sin(angle))
        across = (box["size_x"] * cosine + box["size_y"] * sine) / width  # upright around a box that is turned
        down = (box["size_x"] * sine + box["size_y"] * cosine) / height
        place = {"x": center["x"] / width - across / 2, "y": center["y"] / height - down / 2}
        if ros.BOX in wanted:
            yield ros.BOX, {**common, **place, "width": across, "height": down}
        best = max((result["hypothesis"] for result in results), key=operator.itemgetter("score"), default={})
        label = best.get("class_id", "")
        if label.isascii() and label.isdigit() and int(label) < 2**32 and ros.CLASS in wanted:
            yield ros.CLASS, {**common, "type": int(label)}
        elif label and ros.PROPERTY in wanted:
            yield ros.PROPERTY, {**common, "property": label}


def _pixels(topic: Topic) -> tuple[int, int]:
    if topic.camera is None or not topic.camera.width * topic.camera.height:
        raise RosTypeError(f"{topic.topic} needs its camera's size: boxes are in pixels")
    return topic.camera.width, topic.camera.height
