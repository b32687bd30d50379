"""Frames with detections as a labelled data set in the COCO format (images, and one ``annotations.json``).

A detection is a DetectionBoundingBox; its class is the DetectionProperty (without ``color:``) or else the DetectionType
of the same sender, sample time and detection. It belongs to the frame of the same sample time. If nothing moves, the
labels of all frames may be those of a truth file. A class has the same number in every data set: by its name alone.
Reference: cocodataset.org, "Data format", object detection.
"""

import json
import math
import zlib
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dodo_dsl.opendlv.assets.truth_file import plain
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import DecodedFrame
from dodo_dsl.rec import truth
from dodo_dsl.rec.frames import PictureSet, write_picture

ANNOTATIONS = "annotations.json"
_PREFIX = "opendlv.logic.perception.Detection"
_KINDS = ("BoundingBox", "Property", "Type")
_SLACK = 1e-6
"""Part of a frame by which rounded fractions may reach over its edge."""
_CLASSES = ("blue", "yellow", "red", "orange", "car", "object")
"""Classes with the numbers from 1; others have the CRC-32 of their names, without its uppermost bit."""


class DetectionKey(NamedTuple):
    """The identity of a detection, common to its messages."""

    sample_time: int
    sender_stamp: int
    detection_id: int


@dataclass
class Detection:
    """One labelled box; fractions of the frame, from its upper left."""

    box: tuple[float, float, float, float] | None = None
    label: str = ""
    type: int | None = None

    @property
    def category(self) -> str:
        """The class's name."""
        return self.label or ("object" if self.type is None else f"type {self.type}")


@dataclass
class DataSet:
    """The frames and boxes written so far."""

    images: list[dict[str, Any]] = field(default_factory=list)
    boxes: list[tuple[int, str, list[float]]] = field(default_factory=list)
    cut: int = 0
    empty: int = 0
    """How many boxes reached over an edge of their frames, and how many had no area in them."""

    def text(self, classes: Iterable[str] = ()) -> str:
        """The content of annotations.json, with further ``classes``; raises LabelError."""
        numbers = {name: class_number(name) for name in (*classes, *(name for _, name, _ in self.boxes))}
        by_number = {number: name for name, number in numbers.items()}
        if one := next((name for name, number in numbers.items() if by_number[number] != name), ""):
            raise LabelError(f"the classes '{one}' and '{by_number[numbers[one]]}' have the same number: rename one")
        annotations = [
            {
                "id": number,
                "image_id": image,
                "category_id": numbers[name],
                "bbox": box,
                "area": round(box[2] * box[3], 3),
                "iscrowd": 0,
            }
            for number, (image, name, box) in enumerate(self.boxes, 1)
        ]
        categories = [{"id": number, "name": name, "supercategory": ""} for name, number in sorted(numbers.items())]
        content = {"images": self.images, "annotations": annotations, "categories": categories}
        return json.dumps(content, indent=1, allow_nan=False) + "\n"


def class_number(name: str) -> int:
    """The number of a class in every data set."""
    return _CLASSES.index(name) + 1 if name in _CLASSES else zlib.crc32(name.encode()) & 0x7FFFFFFF


class LabelError(ValueError):
    """Labels that are missing or cannot be written; one sentence."""

    usage = True


def detections(
    recording: Recording, messages: MessageSet, rows: Numbers, sender_stamp: int | None
) -> Mapping[int, list[Detection]]:
    """The detections with a box among the messages of ``rows``, by sample time; of one sender or all."""
    known = messages.names()
    kinds = {messages.id(_PREFIX + name): name for name in _KINDS if _PREFIX + name in known}
    found: defaultdict[DetectionKey, Detection] = defaultdict(Detection)
    chosen = rows[np.isin(recording.index["data_type"][rows], list(kinds))]
    for envelope in recording.envelopes(chosen):
        if sender_stamp not in (None, envelope.sender_stamp):
            continue
        try:
            message = messages.decode(envelope.data_type, envelope.payload)
        except MessageError:
            continue
        key = DetectionKey(envelope.sample_time, envelope.sender_stamp, message.detectionId)
        _take(found[key], kinds[envelope.data_type], message)
    by_time: dict[int, list[Detection]] = {}
    for key in sorted(found):
        if all(map(math.isfinite, found[key].box or (math.nan,))):
            by_time.setdefault(key.sample_time, []).append(found[key])
    return by_time


@dataclass
class CocoExport(PictureSet):
    """Frames and annotations.json; only frames with a label or ``everything``."""

    everything: bool = False
    result: DataSet = field(default_factory=DataSet)
    missing = "has a detection with a box in it; --all exports frames without them"

    def __str__(self) -> str:
        return f"{len(self.images)} frames with {len(self.result.boxes)} boxes"

    @property
    def images(self) -> list[dict[str, Any]]:
        return self.result.images

    @property
    def classes(self) -> Collection[str]:
        """Those of all boxes."""
        return {name for _, name, _ in self.result.boxes}

    def add(
        self, recording: Recording, images: Numbers, labels: Mapping[int, list[Detection]], name: str,
        progress: Callable[[int], None],
    ) -> None:  # fmt: skip
        """Writes the frames of a recording, which has a ``name`` if there are several; raises OSError."""
        for packet, frame, path in self.frames(recording, images, name, progress):
            boxes = _boxes(self.result, frame, labels.get(packet.sample_time, ()))
            if boxes or self.everything:
                write_picture(self.folder / path, frame)
                number, size = len(self.images) + 1, {"width": frame.width, "height": frame.height}
                image = {"id": number, "file_name": path, **size, "sample_time": packet.sample_time}
                self.images.append(image | ({"recording": str(recording.path)} if name else {}))
                self.result.boxes += [(number, label, box) for label, box in boxes]

    def notes(self) -> Iterator[str]:
        yield from super().notes()
        if self.result.cut:
            yield f"cut {self.result.cut} boxes at the edges of their frames"
        if self.result.empty:
            yield f"left out {self.result.empty} boxes without an area in their frames"

    def finish(self, classes: Collection[str]) -> None:
        """Writes annotations.json, with these ``classes``; raises LabelError and OSError."""
        (self.folder / ANNOTATIONS).write_text(self.result.text(classes), encoding="utf-8")


def _take(detection: Detection, kind: str, message: Any) -> None:
    """The first message of a kind counts, as for the evaluator of detections."""
    if kind == "BoundingBox":
        detection.box = detection.box or (message.x, message.y, message.width, message.height)
    elif kind == "Property":
        detection.label = detection.label or plain(message.property)
    elif detection.type is None:
        detection.type = message.type


LabelledBox = tuple[str, list[float]]
"""A class, and x, y, width and height in pixels."""


def _boxes(result: DataSet, frame: DecodedFrame, wanted: Iterable[Detection]) -> list[LabelledBox]:
    """What of the detections' boxes is in their frame, if that has an area."""
    found = []
    for detection in wanted:
        x, y, width, height = detection.box or (0.0, 0.0, 0.0, 0.0)
        ends = (x, frame.width), (y, frame.height), (x + width, frame.width), (y + height, frame.height)
        left, top, right, low = (round(min(max(end, 0.0), 1.0) * side, 3) for end, side in ends)
        if width <= 0 or height <= 0 or left >= right or top >= low:
            result.empty += 1
            continue
        result.cut += min(x, y) < -_SLACK or max(x + width, y + height) > 1 + _SLACK
        found.append((detection.category, [left, top, round(right - left, 3), round(low - top, 3)]))
    return found


def of_truth(recording: Recording, images: Numbers, path: Path) -> Mapping[int, list[Detection]]:
    """The boxes of a truth file for each image message, as of a rig if nothing moves; raises TruthError."""
    found = [Detection(box, label) for label, box in truth.boxes(path)]
    return dict.fromkeys((e.sample_time for e in recording.envelopes(images)), found)
