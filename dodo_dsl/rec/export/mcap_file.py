"""A recording as an MCAP file, in protobuf: a topic for each message and sender stamp, and Foxglove's where they fit.

Reference: mcap.dev, "MCAP File Format", and its registry on the encoding ``protobuf``.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf.message import Message
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from dodo_dsl import __version__
from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec.export import foxglove

_NANOSECONDS = 1000
_PROTOBUF = "protobuf"


@dataclass
class McapCounts:
    """OpenDLV messages, those in schemas of Foxglove beside them, and payloads that are none by id."""

    messages: int = 0
    converted: int = 0
    undecodable: Counter[int] = field(default_factory=Counter)


def write(
    recording: Recording, messages: MessageSet, rows: Numbers, place: Path, progress: Callable[[int], None]
) -> McapCounts:
    """Write the known messages among ``rows`` in the order of their times; ``progress`` gets the number of rows done.

    The log time is the sample time, or where that is zero when the message was received, or else sent; the publish
    time is when it was sent. Times before 1970 become 1970. Memory is bounded by what ``Recording.batches`` holds and
    the file's index. Raises OSError and RecordingError.
    """
    result = McapCounts()
    ordered = rows[np.argsort(recording.index["time"][rows], kind="stable")]
    with place.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library=f"DoDo {__version__}")
        channels = _Channels(writer, messages)
        for done, envelope in enumerate(recording.envelopes(ordered), 1):
            _write_one(channels, envelope, result)
            progress(done)
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
        self._converters: dict[int, foxglove.Convert | None] = {}

    def converter(self, id_: int) -> foxglove.Convert | None:
        """What makes a message of Foxglove of one with this id."""
        if id_ not in self._converters:
            self._converters[id_] = foxglove.converter(self.messages.layout(id_))
        return self._converters[id_]

    def add(self, topic: str, message: Message, payload: bytes, time: int, sent: int) -> None:
        """A message on a topic; times in us since the epoch."""
        if topic not in self._channels:
            type_ = type(message)
            if type_ not in self._schemas:
                self._schemas[type_] = register_schema(self._writer, type_)
            self._channels[topic] = self._writer.register_channel(topic, _PROTOBUF, self._schemas[type_])
        log_time, publish_time = (max(each, 0) * _NANOSECONDS for each in (time, sent))
        self._writer.add_message(self._channels[topic], log_time, payload, publish_time)
