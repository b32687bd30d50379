"""A bag of ROS 2 as a recording, by the types of its topics."""

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from msgspec import structs

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.picture_size import picture_size
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from dodo_dsl.opendlv.ros_codec import Fields, RosTypeError
from dodo_dsl.opendlv.ros_messages import BusMessage, Types, messages_of, time_of
from dodo_dsl.opendlv.ros_pictures import PICTURES, picture_of
from dodo_dsl.opendlv.ros_types import CAMERA_INFO, COMPRESSED, DETECTIONS, CameraView, Topic
from dodo_dsl.opendlv.video import FORMAT, VideoEncoder
from dodo_dsl.rec.bag import READ, Bag, BagError

_IMAGE = "opendlv.proxy.ImageReading"


class BagImport:
    """Makes a recording of a bag, in whose ``topics`` each has its messages; those that are ``known`` keep theirs.

    ``counts`` are the messages that were written, ``skipped`` those that do not fit, with the first of the ``reasons``,
    by topic, and ``left_out`` those of other topics.
    """

    def __init__(self, bag: Bag, types: Types, known: Iterable[Topic], lossy: bool) -> None:
        self.counts, self.skipped, self.reasons = Counter[str](), Counter[str](), dict[str, str]()
        self._bag, self._types, self._lossy = bag, types, lossy
        self._encoders: dict[tuple[str, int, int], VideoEncoder] = {}
        self.topics = {(each.topic, each.type): each for each in self._chosen(known)}
        for topic in self.topics.values():
            types.check(topic)
        self.left_out = {key: count for key, count in bag.counts.items() if key not in self.topics}

    def write(self, place: Path) -> None:
        """Writes the new recording; raises BagError if there is nothing for it."""
        with RecordingWriter(place) as writer:
            for key, time, data in self._bag.messages(self.topics):
                try:
                    for envelope in self._envelopes(self.topics[key], data, time):
                        writer.write(envelope)
                    self.counts[key[0]] += 1
                except (TypeError, ValueError) as error:
                    self.skipped[key[0]] += 1
                    self.reasons.setdefault(key[0], str(error))
            if not writer.frames:
                why = next(iter(self.reasons.values()), "none of its topics has a type that a recording knows")
                raise BagError(f"'{self._bag.path}' has nothing for a recording: {why}")

    def _chosen(self, known: Iterable[Topic]) -> Iterator[Topic]:
        """The topics that a recording can have; those of the same messages get sender stamps."""
        camera, counts = self._camera(), self._bag.counts
        known = (each for each in known if each.bus and each.type not in PICTURES)  # theirs is a shared memory
        own = {(each.topic, each.type): each for each in known if (each.topic, each.type) in counts}
        used = Counter[str]({name: stamp + 1 for each in own.values() for name, stamp in messages_of(each)})
        for key in counts:
            topic, type_ = key
            names = (_IMAGE,) if type_ in PICTURES else READ.get(type_, ())
            if key in own:
                yield structs.replace(own[key], camera=camera)
            elif names and (type_ != DETECTIONS or camera):
                stamp = max(used[name] for name in names)
                used.update(dict.fromkeys(names, 1))
                bus = tuple(f"{name}/{stamp}" for name in names)
                yield Topic(topic=topic, type=type_, bus=bus, camera=camera)

    def _camera(self) -> CameraView | None:
        """The size of pictures in the bag, by the first of them or of what describes them."""
        wanted = [key for key in self._bag.counts if key[1] in (*PICTURES, CAMERA_INFO)]
        for key, _, data in self._bag.messages(wanted):
            try:
                fields = self._types.decode(key[1], data)
            except RosTypeError:
                continue
            size = picture_size(bytes(fields["data"])) if key[1] == COMPRESSED else (fields["width"], fields["height"])
            if size and all(size):
                return CameraView(width=size[0], height=size[1])
        return None

    def _envelopes(self, topic: Topic, data: bytes, time: int) -> Iterator[Envelope]:
        """Those of a message that was stored at ``time`` us."""
        fields, messages = self._types.decode(topic.type, data), self._types.messages
        is_picture = topic.type in PICTURES
        for each in [self._picture(topic, fields, time)] if is_picture else self._types.sent(topic, fields, time):
            id_, payload = messages.id(each.message), messages.encode(each.message)
            yield Envelope(id_, payload, time, time, each.sample_time, each.stamp)

    def _picture(self, topic: Topic, fields: Fields, time: int) -> BusMessage:
        """A JPEG stays as it is; others follow one another in a video."""
        image = picture_of(topic.type, fields)
        height, width = image.shape[:2]
        data, format_ = bytes(fields["data"]), "mjpg"
        if topic.type != COMPRESSED or not data.startswith(b"\xff\xd8"):
            key = topic.topic, width, height
            if key not in self._encoders:
                self._encoders[key] = VideoEncoder("bgr", width, height, lossless=not self._lossy)
            data, format_ = self._encoders[key].encode(image), FORMAT
        type_, number = self._types.messages.type(_IMAGE), self.counts[topic.topic]
        message = type_(format=format_, width=width, height=height, data=data, sampleId=number)
        return BusMessage(message, time_of(fields) or time, dict(messages_of(topic))[_IMAGE])
