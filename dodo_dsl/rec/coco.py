"""Frames with detections as a labelled data set in the COCO format (images, and one ``annotations.json``).

A detection is a DetectionBoundingBox; its class is the DetectionProperty (without ``color:``) or else the DetectionType
of the same sender, sample time and detection. It belongs to the frame of the same sample time.
Reference: cocodataset.org, "Data format", object detection.
"""

import json
import math
import zlib
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv.assets import truth_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.assets.truth_file import plain
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.frames import FramesError, frame_names, frames, write_picture

ANNOTATIONS = "annotations.json"
_BOX, _PROPERTY, _TYPE = (f"opendlv.logic.perception.Detection{kind}" for kind in ("BoundingBox", "Property", "Type"))
_SLACK = 1e-6
"""Part of a frame by which rounded fractions may reach over its edge."""
_CLASSES = ("blue", "yellow", "red", "orange", "car", "object")
"""Classes with the numbers from 1; others have the CRC-32 of their names, without its uppermost bit."""

LabelledBox = tuple[str, tuple[float, float, float, float]]
"""A class, and x, y (upper left corner), width and height."""


@dataclass
class DataSet:
    """Frames and boxes in pixels; how many boxes reached over an edge, and how many had no area in their frames."""

    images: list[dict[str, Any]] = field(default_factory=list)
    boxes: list[tuple[int, LabelledBox]] = field(default_factory=list)
    cut: int = 0
    empty: int = 0

    def text(self, classes: Collection[str]) -> str:
        """The content of annotations.json."""
        annotations = [
            {
                "id": number,
                "image_id": image,
                "category_id": class_number(name),
                "bbox": box,
                "area": round(box[2] * box[3], 3),
                "iscrowd": 0,
            }
            for number, (image, (name, box)) in enumerate(self.boxes, 1)
        ]
        categories = [{"id": class_number(name), "name": name, "supercategory": ""} for name in sorted(classes)]
        content = {"images": self.images, "annotations": annotations, "categories": categories}
        return json.dumps(content, indent=1, allow_nan=False) + "\n"

    def cut_boxes(self, boxes: Iterable[LabelledBox], width: int, height: int) -> list[LabelledBox]:
        """What of boxes in fractions of a frame is in it, in pixels."""
        found = []
        for name, (x, y, wide, high) in boxes:
            ends = (x, width), (y, height), (x + wide, width), (y + high, height)
            left, top, right, low = (round(min(max(end, 0.0), 1.0) * side, 3) for end, side in ends)
            if wide <= 0 or high <= 0 or left >= right or top >= low:
                self.empty += 1
                continue
            self.cut += min(x, y) < -_SLACK or max(x + wide, y + high) > 1 + _SLACK
            found.append((name, (left, top, round(right - left, 3), round(low - top, 3))))
        return found

    def add(
        self, recording: Recording, images: Numbers, labels: Mapping[int, list[LabelledBox]], folder: Path,
        prefix: str, picture_type: str, problem: Callable[[str], None],
    ) -> None:  # fmt: skip
        """Writes the frames with labels, whose names begin with ``prefix``; raises FramesError and OSError."""
        names = frame_names(recording, images, picture_type)
        (folder / "images").mkdir(parents=True, exist_ok=True)
        for number, envelope, frame in frames(recording, images, problem):
            if boxes := self.cut_boxes(labels.get(envelope.sample_time, ()), frame.width, frame.height):
                path, id_ = f"images/{prefix}{names[number]}", len(self.images) + 1
                write_picture(folder / path, frame)
                image = {"id": id_, "file_name": path, "width": frame.width, "height": frame.height}
                image["sample_time"] = envelope.sample_time
                self.images.append(image | ({"recording": str(recording.path)} if prefix else {}))
                self.boxes += [(id_, box) for box in boxes]

    def finish(self, folder: Path, classes: Collection[str], problem: Callable[[str], None]) -> None:
        """Writes annotations.json with all ``classes``; raises OSError."""
        if self.cut:
            problem(f"cut {self.cut} boxes at the edges of their frames")
        if self.empty:
            problem(f"left out {self.empty} boxes without an area in their frames")
        (folder / ANNOTATIONS).write_text(self.text(classes), encoding="utf-8")


def class_number(name: str) -> int:
    """The number of a class in every data set."""
    return _CLASSES.index(name) + 1 if name in _CLASSES else zlib.crc32(name.encode()) & 0x7FFFFFFF


def detections(
    recording: Recording, messages: MessageSet, rows: Numbers, sender_stamp: int | None
) -> Mapping[int, list[LabelledBox]]:
    """The boxes, in fractions of a frame, by sample time in us; of one sender or all.

    The first message of a kind counts, as for the evaluator of detections.
    """
    kinds = {messages.id(name): name for name in (_BOX, _PROPERTY, _TYPE) if name in messages.names()}
    found: defaultdict[tuple[int, int, int], dict[str, Any]] = defaultdict(dict)
    for envelope in recording.envelopes(rows[np.isin(recording.index["data_type"][rows], list(kinds))]):
        if sender_stamp in (None, envelope.sender_stamp):
            try:
                message = messages.decode(envelope.data_type, envelope.payload)
            except MessageError:
                continue
            key = envelope.sample_time, envelope.sender_stamp, message.detectionId
            found[key].setdefault(kinds[envelope.data_type], message)
    by_time = defaultdict[int, list[LabelledBox]](list)
    for key in sorted(found):
        if (box := found[key].get(_BOX)) and all(map(math.isfinite, (box.x, box.y, box.width, box.height))):
            by_time[key[0]].append((_class_of(found[key]), (box.x, box.y, box.width, box.height)))
    return by_time


def _class_of(detection: Mapping[str, Any]) -> str:
    label = plain(detection[_PROPERTY].property) if _PROPERTY in detection else ""
    return label or (f"type {detection[_TYPE].type}" if _TYPE in detection else "object")


def of_truth(recording: Recording, images: Numbers, path: Path) -> Mapping[int, list[LabelledBox]]:
    """The boxes of a truth file for each image message, as of a rig if nothing moves; raises FramesError."""
    try:
        (found,) = truth_file.read(path, "one").values()
    except InputError as error:
        raise FramesError(str(error)) from None
    return dict.fromkeys((e.sample_time for e in recording.envelopes(images)), found)
