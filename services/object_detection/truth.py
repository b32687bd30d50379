"""True boxes from a file in the COCO format (cocodataset.org, "Data format", object detection), in pixels."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from dodo_dsl.opendlv import regular_file
from services.object_detection.boxes import Box, LabelledBox
from services.object_detection.frames import FrameKey, plain

Frames = Literal["one", "sample-time", "number"]

LARGEST = 2**63


class TruthFileError(ValueError):
    """A truth that cannot be used; the message names file and place."""


@dataclass(frozen=True)
class Truth:
    """The true boxes of each picture; ``frames`` says how a frame finds its picture."""

    frames: Frames
    pictures: Mapping[int, tuple[LabelledBox, ...]]

    def picture_of(self, key: FrameKey) -> int:
        """The picture that a frame would have."""
        return {"one": 0, "sample-time": key.time, "number": key.number}[self.frames]

    def of(self, key: FrameKey) -> tuple[LabelledBox, ...] | None:
        """The true boxes of a frame; None where the file does not have it."""
        return self.pictures.get(self.picture_of(key))

    def labels(self) -> list[str]:
        """All its classes, sorted."""
        return sorted({each.label for boxes in self.pictures.values() for each in boxes})


def load(path: Path, frames: Frames) -> Truth:
    """The truth in a file; raises TruthError."""
    try:
        document = json.loads(regular_file.text(path))
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise TruthFileError(f"{path}: cannot be read as COCO JSON: {reason}") from None
    images = {_whole(entry, "id", place): (entry, place) for entry, place in _entries(document, "images", path)}
    if len(images) != len(document["images"]):
        raise TruthFileError(f"{path}: images: two have the same id")
    names = {_whole(entry, "id", place): _name(entry, place) for entry, place in _entries(document, "categories", path)}
    boxes: dict[int, list[LabelledBox]] = {number: [] for number in images}
    for entry, place in _entries(document, "annotations", path):
        image, category = _known(entry, "image_id", images, place), _known(entry, "category_id", names, place)
        boxes[image].append(LabelledBox(names[category], _box(entry, images[image], place)))
    if not any(boxes.values()):
        raise TruthFileError(f"{path}: annotations: no boxes, expected at least one")
    keys = _keys(images, frames, path)
    return Truth(frames, {keys[number]: tuple(found) for number, found in boxes.items()})


def _entries(document: Any, name: str, path: Path) -> Sequence[tuple[dict[str, Any], str]]:
    entries = document.get(name) if isinstance(document, dict) else None
    if not isinstance(entries, list):
        raise TruthFileError(f"{path}: expected an object with a list '{name}'")
    places = [f"{path}: {name}[{index}]" for index in range(len(entries))]
    for entry, place in zip(entries, places, strict=True):
        if not isinstance(entry, dict):
            raise TruthFileError(f"{place}: expected an object")
    return list(zip(entries, places, strict=True))


def _keys(images: Mapping[int, tuple[Any, str]], frames: Frames, path: Path) -> dict[int, int]:
    """Each image's key, by its id."""
    if frames == "number":
        return {number: number for number in images}
    if frames == "sample-time":
        keys = {number: _whole(entry, "sample_time", place) for number, (entry, place) in images.items()}
        if len(set(keys.values())) < len(keys):
            raise TruthFileError(f"{path}: images: two have the same sample_time")
        return keys
    if len(images) > 1:
        raise TruthFileError(f"{path}: has {len(images)} images, expected one for all frames; see --truth-frames")
    return dict.fromkeys(images, 0)


def _box(entry: dict[str, Any], image: tuple[dict[str, Any], str], place: str) -> Box:
    """The box as fractions of its image."""
    if entry.get("iscrowd"):
        raise TruthFileError(f"{place}: iscrowd is set, expected the box of one object")
    width, height = (_whole(image[0], side, image[1], 1) for side in ("width", "height"))
    numbers = entry.get("bbox")
    if not isinstance(numbers, list) or len(numbers) != 4 or not all(map(_is_number, numbers)):
        raise TruthFileError(f"{place}.bbox: expected four numbers [x, y, width, height] in pixels")
    x, y, wide, high = map(float, numbers)
    if wide <= 0 or high <= 0:
        raise TruthFileError(f"{place}.bbox: has no area, {wide:g} x {high:g} pixels")
    if x >= width or y >= height or x + wide <= 0 or y + high <= 0:
        raise TruthFileError(f"{place}.bbox: lies outside its image of {width} x {height} pixels")
    return Box(x / width, y / height, wide / width, high / height)


def _name(entry: dict[str, Any], place: str) -> str:
    name = entry.get("name")
    if not isinstance(name, str) or not plain(name):
        raise TruthFileError(f"{place}.name: expected a string")
    return plain(name)


def _known(entry: dict[str, Any], key: str, known: Mapping[int, object], place: str) -> int:
    number = _whole(entry, key, place)
    if number not in known:
        raise TruthFileError(f"{place}.{key}: no entry has the id {number}")
    return number


def _whole(entry: dict[str, Any], key: str, place: str, least: int = 0) -> int:
    value = entry.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < LARGEST:
        raise TruthFileError(f"{place}.{key}: expected a whole number, {least} or more")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -LARGEST < value < LARGEST
