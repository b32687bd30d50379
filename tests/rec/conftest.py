"""Recordings that tests make themselves."""

from collections.abc import Callable, Iterable
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np
import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet

MESSAGES = MessageSet.standard()
BEGIN = 1_700_000_000_000_000
WIDTH, HEIGHT = 64, 48


class Answer(NamedTuple):
    code: int
    stdout: str
    stderr: str


def dodo_rec(*words: str | Path) -> Answer:
    stdout, stderr = StringIO(), StringIO()
    code = main(["rec", *map(str, words)], stdout, stderr)
    return Answer(code, stdout.getvalue(), stderr.getvalue())


def message(name: str, time: int, sender_stamp: int = 0, **fields: Any) -> Envelope:
    payload = MESSAGES.encode(MESSAGES.type(name)(**fields))
    return Envelope(MESSAGES.id(name), payload, time + 5, time + 9, time, sender_stamp)


def h264(pictures: Iterable[np.ndarray[Any, Any]], key_frame_every: int) -> list[bytes]:
    codec = av.CodecContext.create("libx264", "w")
    codec.width, codec.height, codec.pix_fmt, codec.gop_size = WIDTH, HEIGHT, "yuv420p", key_frame_every
    codec.framerate = 10
    codec.options = {"preset": "ultrafast", "tune": "zerolatency", "crf": "10", "bframes": "0"}
    packets = []
    for number, picture in enumerate(pictures):
        frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
        frame.pts = number
        packets += [bytes(packet) for packet in codec.encode(frame)]
    return packets + [bytes(packet) for packet in codec.encode(None)]


def pictures(count: int) -> list[np.ndarray[Any, Any]]:
    """Grey ones that become brighter."""
    return [np.full((HEIGHT, WIDTH, 3), 20 + 10 * number, np.uint8) for number in range(count)]


def video(count: int = 12, key_frame_every: int = 5, sender_stamp: int = 0) -> list[Envelope]:
    packets = h264(pictures(count), key_frame_every)
    assert len(packets) == count
    size = {"format": "h264", "width": WIDTH, "height": HEIGHT}
    return [
        message("opendlv.proxy.ImageReading", BEGIN + number * 100_000, sender_stamp, data=data, **size)
        for number, data in enumerate(packets)
    ]


@pytest.fixture
def record(tmp_path: Path) -> Callable[..., Path]:
    def write(envelopes: Iterable[Envelope], name: str = "drive.rec", before: bytes = b"", after: bytes = b"") -> Path:
        path = tmp_path / name
        path.write_bytes(before + b"".join(map(encode_frame, envelopes)) + after)
        return path

    return write
