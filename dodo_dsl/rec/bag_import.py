"""A bag of ROS 2 as a recording, by the types of its topics."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from msgspec import structs

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from dodo_dsl.opendlv.ros_codec import Fields, RosTypeError
from dodo_dsl.opendlv.ros_fields import CAMERA_INFO, COMPRESSED, DETECTIONS
from dodo_dsl.opendlv.ros_messages import Types, messages_of, time_of
from dodo_dsl.opendlv.ros_pictures import PICTURES, picture_of
from dodo_dsl.opendlv.ros_types import CameraView, Topic
from dodo_dsl.opendlv.video import FORMAT, VideoEncoder, VideoError
from dodo_dsl.rec.bag import READ, Bag, BagError

IMAGE = "opendlv.proxy.ImageReading"
_JPEG, _MJPEG = b"\xff\xd8", "mjpg"


@dataclass
class Imported:
    """What became of a bag: the messages of each topic, those left out by topic and type, and why some were skipped."""

    topics: Mapping[str, Topic]
    left_out: Mapping[tuple[str, str], int]
    counts: Counter[str] = field(default_factory=Counter)
    skipped: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)


def topics_of(bag: Bag, camera: CameraView | None, known: Iterable[Topic]) -> dict[str, Topic]:
    """The topics that a recording can have, each with its messages; topics of the same messages get sender stamps.

    Those that are ``known`` have the messages that are written.
    """
    there = [each for each in known if (each.topic, each.type) in bag.counts and each.bus]
    found = {each.topic: structs.replace(each, camera=camera) for each in there}
    used = Counter[str]({name: stamp + 1 for each in there for name, stamp in messages_of(each)})
    for topic, type_ in bag.counts:
        names = (IMAGE,) if type_ in PICTURES else READ.get(type_, ())
        if not names or topic in found or (type_ == DETECTIONS and camera is None):
            continue
        stamp = max(used[name] for name in names)
        used.update(dict.fromkeys(names, stamp + 1 - min(used[name] for name in names)))
        found[topic] = Topic(topic=topic, type=type_, bus=tuple(f"{name}/{stamp}" for name in names), camera=camera)
    return found


def import_bag(
    bag: Bag, place: Path, lossy: bool, known: Iterable[Topic], types: Types, progress: Callable[[int], None]
) -> Imported:
    """Write the messages of a bag into the new recording ``place``; raises BagError if there are none for it."""
    topics = topics_of(bag, _camera(bag, types), known)
    for topic in topics.values():
        types.check(topic)
    kept = {(topic.topic, topic.type) for topic in topics.values()}
    result = Imported(topics, {key: count for key, count in bag.counts.items() if key not in kept})
    converter = _Converter(types, lossy)
    with RecordingWriter(place) as writer:
        for done, stored in enumerate(bag.messages(lambda *key: key in kept), 1):
            try:
                for envelope in converter.envelopes(topics[stored.topic], stored.data, stored.time):
                    writer.write(envelope)
            except (VideoError, TypeError, ValueError) as error:
                result.skipped[stored.topic] += 1
                result.reasons.setdefault(stored.topic, str(error))
            else:
                result.counts[stored.topic] += 1
            progress(done)
        if not writer.frames:
            why = next(iter(result.reasons.values()), "none of its topics has a type that a recording knows")
            raise BagError(f"'{bag.path}' has nothing for a recording: {why}")
    return result


def _camera(bag: Bag, types: Types) -> CameraView | None:
    """The size of pictures in the bag, by the first of them or of what describes them."""
    sizes = (*PICTURES, CAMERA_INFO)
    for stored in bag.messages(lambda _, type_: type_ in sizes):
        try:
            fields = types.decode(stored.type, stored.data)
            if stored.type == COMPRESSED:
                height, width = picture_of(stored.type, fields).shape[:2]
            else:
                height, width = fields["height"], fields["width"]
        except RosTypeError:
            continue
        if width and height:
            return CameraView(width=width, height=height, fovy=0.0)
    return None


class _Converter:
    """Makes envelopes of the messages of topics; pictures of a topic follow one another in a video."""

    def __init__(self, types: Types, lossy: bool) -> None:
        self._types, self._lossy = types, lossy
        self._encoders: dict[tuple[str, int, int], VideoEncoder] = {}
        self._pictures = Counter[str]()

    def envelopes(self, topic: Topic, data: bytes, time: int) -> Iterator[Envelope]:
        """Those of a message that was stored at ``time`` us."""
        fields = self._types.decode(topic.type, data)
        if topic.type in PICTURES:
            yield self._picture(topic, fields, time)
            return
        for name, stamp, sample_time, values in self._types.sent(topic, fields, time):
            yield self._envelope(name, stamp, sample_time, time, values)

    def _picture(self, topic: Topic, fields: Fields, time: int) -> Envelope:
        image = picture_of(topic.type, fields)
        height, width = image.shape[:2]
        data, format_ = bytes(fields["data"]) if topic.type == COMPRESSED else b"", _MJPEG
        if not data.startswith(_JPEG):
            key = topic.topic, width, height
            if key not in self._encoders:
                self._encoders[key] = VideoEncoder("bgr", width, height, lossless=not self._lossy)
            data, format_ = self._encoders[key].encode(image), FORMAT
        number = self._pictures[topic.topic]
        self._pictures[topic.topic] += 1
        values = {"format": format_, "width": width, "height": height, "data": data, "sampleId": number}
        stamp = int(topic.bus[0].partition("/")[2])
        return self._envelope(IMAGE, stamp, time_of(fields) or time, time, values)

    def _envelope(self, name: str, stamp: int, sample_time: int, time: int, values: Fields) -> Envelope:
        messages = self._types.messages
        payload = messages.encode(messages.type(name)(**values))
        return Envelope(messages.id(name), payload, time, time, sample_time, stamp)
