"""Recordings made for tests: messages and pictures at times in seconds."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording_writer import RecordingWriter
from dodo_dsl.opendlv.video import VideoEncoder

S = 1_000_000
T0 = 1_600_000_000 * S
WIDTH, HEIGHT = 64, 48
IMAGE = "opendlv.proxy.ImageReading"


def message(name: str, time: float, sender_stamp: int = 0, **fields: Any) -> Envelope:
    messages = MessageSet.standard()
    payload = messages.encode(messages.type(name)(**fields))
    sampled = T0 + round(time * S)
    return Envelope(messages.id(name), payload, sampled + 7, sampled + 9, sampled, sender_stamp)


def picture(number: int) -> pixels.Picture:
    """I420 of one's own for each number."""
    data = np.random.default_rng(number).integers(0, 256, pixels.size("i420", WIDTH, HEIGHT), np.uint8)
    return pixels.view(data, "i420", WIDTH, HEIGHT)


def images(times: Sequence[float], key_interval: int = 4, sender_stamp: int = 0) -> list[Envelope]:
    """Lossless pictures, number 0 first."""
    encoder = VideoEncoder("i420", WIDTH, HEIGHT, key_interval, lossless=True)
    fields = {"format": "h264", "width": WIDTH, "height": HEIGHT}
    return [
        message(IMAGE, time, sender_stamp, data=encoder.encode(picture(number)), **fields)
        for number, time in enumerate(times)
    ]


def write(path: Path, envelopes: Iterable[Envelope]) -> Path:
    with RecordingWriter(path) as writer:
        for envelope in envelopes:
            writer.write(envelope)
    return path
