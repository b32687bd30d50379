"""Pictures from an image, a video or a recording, repeated."""

import importlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dodo_dsl.opendlv.video.picture_size import problem_of, too_large
from services.camera.picture import Image, SharedPicture, from_bgr

MAX_BYTES = 64 << 20
RECORDING = ".rec"
IMAGE_READING = 1055
_SIDES = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)


class FileCamera:
    """One picture of the file for each ``read``, in order, and from the first again after the last."""

    def __init__(self, path: Path, width: int, height: int) -> None:
        """Pictures are scaled to ``width`` and ``height``; raises ValueError or OSError for a file without any."""
        if not path.is_file():
            raise OSError(f"there is no file '{path}'")
        self._path, self._size = path, (width, height)
        self._still = still(path)
        first = next(self._begun(), None)
        if first is None:
            raise ValueError(f"{path} has no pictures, expected an image, a video or a recording")
        self._left = chain([first], self._skipped()) if self._still is None else iter(())

    def read(self) -> SharedPicture:
        """The next picture, without a time."""
        if self._still is not None:
            return from_bgr(self._still, *self._size)
        picture = next(self._left, None)
        if picture is None:
            self._left = self._begun()
            picture = next(self._left)
        return from_bgr(picture, *self._size)

    def close(self) -> None:
        """Close the file."""
        self._left = iter(())

    def _begun(self) -> Iterator[Image]:
        if self._still is not None:
            return iter([self._still])
        return recorded(self._path) if self._path.suffix == RECORDING else filmed(self._path)

    def _skipped(self) -> Iterator[Image]:
        pictures = self._begun()
        next(pictures)
        return pictures


def still(path: Path) -> Image | None:
    """The picture of an image file, None for other files; raises ValueError for one that is too large to be decoded."""
    if not cv2.haveImageReader(str(path)):
        return None
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: an image of {path.stat().st_size} bytes, expected at most {MAX_BYTES}")
    data = path.read_bytes()
    if problem := problem_of(data):
        raise ValueError(f"{path}: {problem}")
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if picture is None else np.asarray(picture, np.uint8)


def filmed(path: Path) -> Iterator[Image]:
    """The pictures of a video, as B, G, R."""
    capture: Any = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        if problem := too_large(*(round(capture.get(side)) for side in _SIDES)):
            raise ValueError(f"{path}: {problem}")
        while (found := capture.read())[0]:
            yield np.asarray(found[1], np.uint8)
    finally:
        capture.release()


def recorded(path: Path) -> Iterator[Image]:
    """The pictures of an OpenDLV recording's first camera, as B, G, R; raises ValueError where none can be decoded."""
    try:
        video = importlib.import_module("dodo_dsl.opendlv.video.decoder")
        reader = importlib.import_module("dodo_dsl.opendlv.recordings.recording")
    except ImportError as error:
        raise ValueError(f"recordings cannot be read here: {error}") from None
    from dodo_dsl.opendlv.messages.message_set import MessageSet

    messages, decoder, sender = MessageSet.standard(), None, None
    for envelope in reader.read_envelopes(path):
        sender = envelope.sender_stamp if sender is None and envelope.data_type == IMAGE_READING else sender
        if (envelope.data_type, envelope.sender_stamp) == (IMAGE_READING, sender):
            reading = messages.decode(IMAGE_READING, envelope.payload)
            video.refuse_large(reading.width, reading.height)
            decoder = decoder or video.VideoDecoder(reading.format)
            frame = decoder.decode(reading.data)
            if frame is not None:
                yield frame.pixels("bgr")
