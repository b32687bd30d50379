"""A recording as a bag of ROS 2, with a topic for each message that has a type there."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
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
from dodo_dsl.opendlv.ros_messages import CameraPicture, Types, messages_of
from dodo_dsl.opendlv.ros_types import SENT, CameraView, Topic
from dodo_dsl.opendlv.video import CODECS, VideoDecoder, VideoError
from dodo_dsl.rec.bag import WRITTEN, BagWriter
from dodo_dsl.rec.frames import IMAGE, packets

_BOX, _PROPERTY, _CLASS = SENT[DETECTIONS]


@dataclass
class _Gathered:
    """The messages of a topic that belong together because they have the same sample time."""

    topic: Topic
    time: int = 0
    fresh: list[tuple[str, Any]] = field(default_factory=list)
    latest: dict[str, Any] = field(default_factory=dict)


class BagExport:
    """Writes messages in the order of their times, stored at their sample times.

    ``left_out`` are those without a counterpart, by their ids; ``skipped`` those that do not fit, by topic, with the
    first of the ``reasons``. Topics that are ``known`` keep their names, if they are the only one of their type.
    """

    def __init__(self, recording: Recording, types: Types, writer: BagWriter, known: Sequence[Topic]) -> None:
        self.left_out, self.skipped, self.reasons = Counter[int](), Counter[str](), dict[str, str]()
        self._recording, self._messages, self._types = recording, types.messages, types
        self._writer, self._known = writer, known
        self._decoders: dict[tuple[int, str], VideoDecoder] = {}

    def write(self, rows: Numbers, progress: Callable[[int], None]) -> None:
        """Write the messages of some rows; ``progress`` gets how many are done."""
        routes, cameras = self._routes(rows), self._stamps(rows, IMAGE)
        ordered = rows[np.argsort(self._recording.index["time"][rows], kind="stable")]
        for done, envelope in enumerate(self._recording.envelopes(ordered), 1):
            key = envelope.data_type, envelope.sender_stamp
            if envelope.data_type == IMAGE:
                self._picture(envelope, is_first=key[1] == cameras[0])
            elif key in routes:
                self._gather(routes[key], envelope)
            else:
                self.left_out[envelope.data_type] += 1
            progress(done)
        for gathered in (each for some in routes.values() for each in some):
            self._store(gathered)

    def _stamps(self, rows: Numbers, id_: int) -> list[int]:
        index = self._recording.index[rows]
        return sorted(set(index["sender_stamp"][index["data_type"] == id_].tolist()))

    def _routes(self, rows: Numbers) -> dict[tuple[int, int], list[_Gathered]]:
        """The topics that each message, by id and sender stamp, is part of."""
        images = rows[self._recording.index["data_type"][rows] == IMAGE][:1]
        sizes = (CameraView(width=each.width, height=each.height) for each in packets(self._recording, images))
        camera = next((each for each in sizes if each.width and each.height), None)
        found = defaultdict[tuple[int, int], list[_Gathered]](list)
        known = set(self._messages.names())  # set 0.9 lacks some
        for way in (each for each in WRITTEN if known.issuperset(each.messages)):
            stamps = {name: self._stamps(rows, self._messages.id(name)) for name in way.messages}
            for number, stamp in enumerate(sorted({one for some in stamps.values() for one in some})):
                parts = [name for name in way.messages if stamp in stamps[name]]
                if (len(parts) < len(way.messages) and not way.is_any) or (way.type == DETECTIONS and not camera):
                    continue
                bus = tuple(f"{name}/{stamp}" for name in parts)
                usual = self._name(way.type, way.topic, way.messages)
                topic = f"{usual}_{stamp}" if number else usual
                gathered = _Gathered(Topic(topic=topic, type=way.type, bus=bus, camera=camera))
                for name in parts:
                    found[self._messages.id(name), stamp].append(gathered)
        return found

    def _gather(self, routes: Iterable[_Gathered], envelope: Envelope) -> None:
        time, name = _time(envelope), self._messages.name(envelope.data_type)
        for gathered in routes:
            try:
                message = self._messages.decode(envelope.data_type, envelope.payload)
            except MessageError as error:
                self._skip(gathered.topic.topic, error)
                continue
            is_list = gathered.topic.type == DETECTIONS
            if gathered.time != time or (name in dict(gathered.fresh) and not is_list):
                self._store(gathered)
            gathered.time, gathered.latest[name] = time, message
            gathered.fresh.append((name, message))
            if len(gathered.fresh) == len(gathered.topic.bus) and not is_list:
                self._store(gathered)

    def _store(self, gathered: _Gathered) -> None:
        """Write what was gathered, if anything was."""
        fresh, gathered.fresh = gathered.fresh, []
        topic, time = gathered.topic, gathered.time
        if not fresh:
            return
        try:
            if topic.type == DETECTIONS:
                fields = self._types.given_header(topic, time) | _detections(topic, fresh)
            else:
                fields = self._types.given(topic, gathered.latest, time)
            self._writer.write(topic.topic, topic.type, time, self._types.encode(topic.type, fields))
        except RosTypeError as error:
            self._skip(topic.topic, error)

    def _picture(self, envelope: Envelope, is_first: bool) -> None:
        """A JPEG stays as it is, others are decoded."""
        time, name = _time(envelope), "/camera/image_raw" if is_first else f"/camera_{envelope.sender_stamp}/image_raw"
        try:
            image = MessageSet.standard().decode(IMAGE, envelope.payload)  # set 0.9 has the same numbers
            if CODECS.get(image.format) == "mjpeg":
                name = f"{name}/compressed"
                topic = Topic(topic=self._name(COMPRESSED, name) if is_first else name, type=COMPRESSED, bus=())
                fields = self._types.given_header(topic, time) | {"format": "jpeg", "data": image.data}
            else:
                topic = Topic(topic=self._name(IMAGE_TYPE, name) if is_first else name, type=IMAGE_TYPE, bus=())
                fields = self._types.given(topic, {}, time, self._decoded(image, envelope.sender_stamp))
            self._writer.write(topic.topic, topic.type, time, self._types.encode(topic.type, fields))
        except (MessageError, RosTypeError, VideoError) as error:
            self._skip(name, error)

    def _name(self, type_: str, usual: str, messages: Sequence[str] = ()) -> str:
        """That of the application's only topic of a type, if it is of no other messages."""
        own = [each for each in self._known if each.type == type_]
        fits = len(own) == 1 and {name for name, _ in messages_of(own[0])} in (set(), set(messages))
        return own[0].topic if fits else usual

    def _decoded(self, image: Any, stamp: int) -> CameraPicture:
        key = stamp, image.format
        if key not in self._decoders:
            self._decoders[key] = VideoDecoder(image.format)
        frame = self._decoders[key].decode(image.data)
        if frame is None:
            raise VideoError("a packet cannot be decoded")
        return CameraPicture(frame.pixels("bgr"), "bgr")

    def _skip(self, topic: str, error: Exception) -> None:
        self.skipped[topic] += 1
        self.reasons.setdefault(topic, str(error))


def _time(envelope: Envelope) -> int:
    return envelope.sample_time or envelope.received or envelope.sent


def _detections(topic: Topic, found: list[tuple[str, Any]]) -> Fields:
    """Boxes in pixels with their class; its score is 1, as the bus has none."""
    assert topic.camera is not None
    width, height = topic.camera.width, topic.camera.height
    labels = {each.detectionId: str(each.type) for name, each in found if name == _CLASS}
    labels |= {each.detectionId: each.property for name, each in found if name == _PROPERTY}
    detections = []
    for box in (each for name, each in found if name == _BOX):
        center = {"x": (box.x + box.width / 2) * width, "y": (box.y + box.height / 2) * height}
        bbox = {"center": {"position": center}, "size_x": box.width * width, "size_y": box.height * height}
        label = labels.get(box.detectionId)
        results = [{"hypothesis": {"class_id": label, "score": 1.0}}] if label else []
        detections.append({"bbox": bbox, "results": results})
    return {"detections": detections}
