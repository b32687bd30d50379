"""A recording as a bag of ROS 2, with a topic for each message that has a type there."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.frame_decoder import FrameDecoder, image_of
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.ros_codec import Fields, RosTypeError
from dodo_dsl.opendlv.ros_messages import Types
from dodo_dsl.opendlv.ros_pictures import CameraPicture
from dodo_dsl.opendlv.ros_types import COMPRESSED, DETECTIONS, CameraView, Topic
from dodo_dsl.opendlv.ros_types import IMAGE as IMAGE_TYPE
from dodo_dsl.opendlv.video import CODECS, VideoError
from dodo_dsl.rec.bag import WRITTEN, Key


@dataclass
class _Gathered:
    """The messages of a topic that belong together because they have the same sample time."""

    topic: Topic
    time: int = 0
    fresh: set[str] = field(default_factory=set)
    latest: dict[str, Any] = field(default_factory=dict)
    """Of each name the last message, or of detections a list of those with the same time."""


class BagExport:
    """Writes messages in the order of their times, stored at their sample times; ``counts`` are those of each topic.

    ``left_out`` are those without a counterpart, by their ids; ``skipped`` those that do not fit, by topic, with the
    first of the ``reasons``.
    """

    def __init__(self, recording: Recording, types: Types, writer: Any) -> None:
        self.counts, self.left_out = Counter[Key](), Counter[int]()
        self.skipped, self.reasons = Counter[str](), dict[str, str]()
        self._recording, self._types, self._messages, self._writer = recording, types, types.messages, writer
        self._connections: dict[str, Any] = {}
        self._decoder = FrameDecoder()

    def write(self, rows: Numbers) -> None:
        index = self._recording.index[rows]
        there = sorted(set(zip(index["data_type"].tolist(), index["sender_stamp"].tolist(), strict=True)))
        first = next((stamp for id_, stamp in there if id_ == IMAGE), None)
        routes = defaultdict[tuple[int, int], list[_Gathered]](list)
        for topic in self._topics(there, rows[index["data_type"] == IMAGE][:1]):
            gathered = _Gathered(topic)
            for name in topic.bus:
                id_, stamp = self._messages.key(name)
                routes[id_, stamp or 0].append(gathered)
        for envelope in self._recording.envelopes(rows[np.argsort(index["time"], kind="stable")]):
            key = envelope.data_type, envelope.sender_stamp
            if envelope.data_type == IMAGE:
                self._picture(envelope, "/camera" if key[1] == first else f"/camera_{key[1]}")
            elif key not in routes:
                self.left_out[envelope.data_type] += 1
            for gathered in routes.get(key, ()):
                self._gather(gathered, envelope)
        for gathered in (each for some in routes.values() for each in some):
            self._store(gathered)

    def _topics(self, there: list[tuple[int, int]], images: Numbers) -> Iterator[Topic]:
        """Those of which there are all messages, or of detections any; ``there`` are ids with their senders."""
        sizes = [CameraView(width=i.width, height=i.height) for i in map(image_of, self._recording.envelopes(images))]
        camera = next((each for each in sizes if each.width and each.height), None)
        known = set(self._messages.names())  # set 0.9 lacks some
        for name, (type_, messages) in WRITTEN.items():
            ids = {self._messages.id(each): each for each in messages} if known.issuperset(messages) else {}
            for number, stamp in enumerate(sorted({stamp for id_, stamp in there if id_ in ids})):
                bus = tuple(f"{each}/{stamp}" for id_, each in ids.items() if (id_, stamp) in there)
                if len(bus) == len(ids) or (type_ == DETECTIONS and camera):
                    yield Topic(topic=f"{name}_{stamp}" if number else name, type=type_, bus=bus, camera=camera)

    def _gather(self, gathered: _Gathered, envelope: Envelope) -> None:
        time, name = _time(envelope), self._messages.name(envelope.data_type)
        is_list = gathered.topic.type == DETECTIONS
        try:
            message = self._messages.decode(envelope.data_type, envelope.payload)
        except MessageError as error:
            self._skip(gathered.topic.topic, error)
            return
        if gathered.time != time or (name in gathered.fresh and not is_list):
            self._store(gathered)
        gathered.time = time
        gathered.fresh.add(name)
        gathered.latest[name] = [*gathered.latest.get(name, ()), message] if is_list else message
        if len(gathered.fresh) == len(gathered.topic.bus) and not is_list:
            self._store(gathered)

    def _store(self, gathered: _Gathered) -> None:
        """Write what was gathered, if anything was."""
        topic, time = gathered.topic, gathered.time
        try:
            if gathered.fresh:
                self._write(topic, time, self._types.given(topic, gathered.latest, time))
        except ValueError as error:
            self._skip(topic.topic, error)
        gathered.fresh.clear()
        if topic.type == DETECTIONS:
            gathered.latest.clear()

    def _picture(self, envelope: Envelope, camera: str) -> None:
        """A JPEG stays as it is, others are decoded."""
        time, topic = _time(envelope), Topic(topic=f"{camera}/image_raw", type=IMAGE_TYPE, bus=())
        try:
            image = image_of(envelope)
            if CODECS.get(image.format) == "mjpeg":
                topic = Topic(topic=f"{topic.topic}/compressed", type=COMPRESSED, bus=())
                data = {"format": "jpeg", "data": np.frombuffer(image.data, np.uint8)}
                fields = self._types.given_header(topic, time) | data
            else:
                if (frame := self._decoder.decode(envelope)) is None:
                    raise VideoError("a packet cannot be decoded")
                fields = self._types.given(topic, {}, time, CameraPicture(frame.pixels("bgr"), "bgr"))
            self._write(topic, time, fields)
        except ValueError as error:
            self._skip(topic.topic, error)

    def _write(self, topic: Topic, time: int, fields: Fields) -> None:
        data = self._types.encode(topic.type, fields)
        if time < 0:
            raise RosTypeError(f"{time} us is before 1970")
        if topic.topic not in self._connections:
            made = self._writer.add_connection(topic.topic, topic.type, typestore=self._types.store)
            self._connections[topic.topic] = made
        self._writer.write(self._connections[topic.topic], time * 1000, data)
        self.counts[topic.topic, topic.type] += 1

    def _skip(self, topic: str, error: Exception) -> None:
        self.skipped[topic] += 1
        self.reasons.setdefault(topic, str(error))


def _time(envelope: Envelope) -> int:
    return envelope.sample_time or envelope.received or envelope.sent
