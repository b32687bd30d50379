"""A recording as a bag of ROS 2, with a topic for each message that has a type there."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.ros_codec import Fields, RosTypeError
from dodo_dsl.opendlv.ros_fields import COMPRESSED, DETECTIONS
from dodo_dsl.opendlv.ros_fields import IMAGE as IMAGE_TYPE
from dodo_dsl.opendlv.ros_messages import CameraPicture, Types, stamp_of
from dodo_dsl.opendlv.ros_types import CameraView, Topic
from dodo_dsl.opendlv.video import CODECS, VideoDecoder, VideoError
from dodo_dsl.rec.bag import WRITTEN, BagWriter
from dodo_dsl.rec.frames import IMAGE, packets

_BOX, _PROPERTY, _CLASS = WRITTEN[-1].messages


@dataclass
class Exported:
    """``left_out`` are messages without a counterpart, by their ids; ``skipped`` those that do not fit, by topic."""

    left_out: Counter[int] = field(default_factory=Counter)
    skipped: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)

    def skip(self, topic: str, reason: str) -> None:
        """One message of a topic."""
        self.skipped[topic] += 1
        self.reasons.setdefault(topic, reason)


@dataclass
class _Gathered:
    """The messages of a topic that belong together because they have the same sample time."""

    topic: Topic
    time: int = 0
    fresh: list[tuple[str, Any]] = field(default_factory=list)
    latest: dict[str, Any] = field(default_factory=dict)

    @property
    def is_whole(self) -> bool:
        return self.topic.type != DETECTIONS and len({name for name, _ in self.fresh}) == len(self.topic.bus)

    def goes_on(self, name: str, time: int) -> bool:
        """Whether a message is one of those that are here already."""
        is_new = self.topic.type == DETECTIONS or name not in dict(self.fresh)
        return not self.fresh or (time == self.time and is_new)

    def add(self, name: str, message: Any, time: int) -> None:
        self.time = time
        self.latest[name] = message
        self.fresh.append((name, message))

    def fields(self, types: Types) -> Fields:
        """Those of the ROS message; raises RosTypeError."""
        fresh, self.fresh = self.fresh, []
        if self.topic.type == DETECTIONS:
            return _detections(self.topic, fresh, self.time)
        return types.given(self.topic, self.latest, self.time)


def export_bag(
    recording: Recording,
    messages: MessageSet,
    rows: Numbers,
    writer: BagWriter,
    types: Types,
    progress: Callable[[int], None],
) -> Exported:
    """Write the messages among ``rows`` in the order of their times, stored at their sample times."""
    result = Exported()
    routes = _routes(recording, messages, rows)
    cameras = _Cameras(recording, rows, types)
    ordered = rows[np.argsort(recording.index["time"][rows], kind="stable")]
    for done, envelope in enumerate(recording.envelopes(ordered), 1):
        key = envelope.data_type, envelope.sender_stamp
        time = envelope.sample_time or envelope.received or envelope.sent
        if envelope.data_type == IMAGE:
            cameras.write(envelope, time, writer, result)
        elif key in routes:
            _take(routes[key], messages, envelope, time, lambda each: _store(each, types, writer, result), result)
        else:
            result.left_out[envelope.data_type] += 1
        progress(done)
    for gathered in {id(each): each for some in routes.values() for each in some}.values():
        if gathered.fresh:
            _store(gathered, types, writer, result)
    return result


def _take(
    routes: list[_Gathered],
    messages: MessageSet,
    envelope: Envelope,
    time: int,
    store: Callable[[_Gathered], None],
    result: Exported,
) -> None:
    try:
        message = messages.decode(envelope.data_type, envelope.payload)
    except MessageError as error:
        result.skip(routes[0].topic.topic, str(error))
        return
    name = messages.name(envelope.data_type)
    for gathered in routes:
        if not gathered.goes_on(name, time):
            store(gathered)
        gathered.add(name, message, time)
        if gathered.is_whole:
            store(gathered)


def _store(gathered: _Gathered, types: Types, writer: BagWriter, result: Exported) -> None:
    topic = gathered.topic
    try:
        data = types.encode(topic.type, gathered.fields(types))
    except RosTypeError as error:
        result.skip(topic.topic, str(error))
    else:
        writer.write(topic.topic, topic.type, gathered.time, data)


def _routes(recording: Recording, messages: MessageSet, rows: Numbers) -> dict[tuple[int, int], list[_Gathered]]:
    """The topics that each message, by id and sender stamp, is part of."""
    index = recording.index[rows]
    there = set(zip(index["data_type"].tolist(), index["sender_stamp"].tolist(), strict=True))
    images = rows[index["data_type"] == IMAGE][:1]
    size = next(((each.width, each.height) for each in packets(recording, images)), (0, 0))
    camera = CameraView(width=size[0], height=size[1], fovy=0.0) if all(size) else None
    found = defaultdict[tuple[int, int], list[_Gathered]](list)
    for way in WRITTEN:
        ids = {messages.id(name): name for name in way.messages if name in messages.names()}
        stamps = sorted({stamp for id_, stamp in there if id_ in ids})
        for number, stamp in enumerate(stamps):
            parts = [id_ for id_ in ids if (id_, stamp) in there]
            if (len(parts) < len(way.messages) and not way.is_any) or (way.type == DETECTIONS and camera is None):
                continue
            name = f"{way.topic}_{stamp}" if number else way.topic
            bus = tuple(f"{ids[id_]}/{stamp}" for id_ in parts)
            gathered = _Gathered(Topic(topic=name, type=way.type, bus=bus, camera=camera))
            for id_ in parts:
                found[id_, stamp].append(gathered)
    return found


class _Cameras:
    """Pictures of a recording: JPEG ones stay as they are, others are decoded."""

    def __init__(self, recording: Recording, rows: Numbers, types: Types) -> None:
        index = recording.index[rows]
        stamps = sorted(set(index["sender_stamp"][index["data_type"] == IMAGE].tolist()))
        self._names = {stamp: f"camera_{stamp}" if number else "camera" for number, stamp in enumerate(stamps)}
        self._decoders: dict[tuple[int, str], VideoDecoder] = {}
        self._types, self._messages = types, MessageSet.standard()

    def write(self, envelope: Envelope, time: int, writer: BagWriter, result: Exported) -> None:
        topic = Topic(topic=f"/{self._names[envelope.sender_stamp]}/image_raw", type=IMAGE_TYPE, bus=())
        try:
            image = self._messages.decode(IMAGE, envelope.payload)
            if CODECS.get(image.format) == "mjpeg":
                topic = Topic(topic=f"{topic.topic}/compressed", type=COMPRESSED, bus=())
                header = self._types.given_header(topic, time)
                fields = header | {"format": "jpeg", "data": np.frombuffer(image.data, np.uint8)}
            else:
                fields = self._decoded(topic, image, envelope.sender_stamp, time)
            writer.write(topic.topic, topic.type, time, self._types.encode(topic.type, fields))
        except (MessageError, RosTypeError, VideoError) as error:
            result.skip(topic.topic, str(error))

    def _decoded(self, topic: Topic, image: Any, stamp: int, time: int) -> Fields:
        key = stamp, image.format
        if key not in self._decoders:
            self._decoders[key] = VideoDecoder(image.format)
        frame = self._decoders[key].decode(image.data)
        if frame is None:
            raise VideoError("a packet cannot be decoded")
        return self._types.given(topic, {}, time, CameraPicture(frame.pixels("bgr"), "bgr"))


def _detections(topic: Topic, found: list[tuple[str, Any]], time: int) -> Fields:
    """Boxes in pixels with their class; the score of what has none is 1."""
    assert topic.camera is not None
    header = {"stamp": stamp_of(time), "frame_id": "camera_optical_frame"}
    labels = {each.detectionId: str(each.type) for name, each in found if name == _CLASS}
    labels |= {each.detectionId: each.property for name, each in found if name == _PROPERTY}
    width, height = topic.camera.width, topic.camera.height
    detections = [
        {
            "header": header,
            "bbox": {
                "center": {"position": {"x": (box.x + box.width / 2) * width, "y": (box.y + box.height / 2) * height}},
                "size_x": box.width * width,
                "size_y": box.height * height,
            },
            "results": list(_hypothesis(labels.get(box.detectionId))),
        }
        for name, box in found
        if name == _BOX
    ]
    return {"header": header, "detections": detections}


def _hypothesis(label: str | None) -> Iterator[Fields]:
    if label:
        yield {"hypothesis": {"class_id": label, "score": 1.0}}
