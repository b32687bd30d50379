"""True boxes from a file in the COCO format (cocodataset.org, "Data format", object detection), in pixels."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from msgspec import Meta, Struct

from dodo_dsl.opendlv.assets.json_file import converted, load, near
from dodo_dsl.opendlv.assets.problem import InputError

Frames = Literal["one", "sample-time", "number"]
Area = tuple[float, float, float, float]
"""x, y, width and height as fractions of the image."""
PREFIX = "color:"

Whole = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Pixels = Annotated[float, Meta(ge=-(2**53), le=2**53)]


class Picture(Struct, frozen=True):
    id: Whole
    width: Annotated[int, Meta(ge=1, lt=2**31)]
    height: Annotated[int, Meta(ge=1, lt=2**31)]
    sample_time: Whole | None = None


class Category(Struct, frozen=True):
    id: Whole
    name: Annotated[str, Meta(pattern=r"^(?!\s*(color:)?\s*$)")]


class Annotation(Struct, frozen=True):
    """The box of one object: x, y of the upper left corner, width and height in pixels."""

    image_id: Whole
    category_id: Whole
    bbox: tuple[Pixels, Pixels, Pixels, Pixels]
    iscrowd: Any = 0


class Truth(Struct, frozen=True):
    """What is read of a file, others of its keys are not."""

    images: list[Picture]
    annotations: list[Annotation]
    categories: list[Category]


def plain(label: str) -> str:
    """A class without ``color:`` and blanks around it."""
    return label.strip().removeprefix(PREFIX).strip()


def read(path: Path, frames: Frames) -> dict[int, list[tuple[str, Area]]]:
    """The classes and boxes of each image, by what distinguishes images; raises InputError."""
    truth = converted(path, load(path), Truth)
    images, names = _by_id(path, "images", truth.images), _by_id(path, "categories", truth.categories)
    boxes: dict[int, list[tuple[str, Area]]] = {number: [] for number in images}
    for index, entry in enumerate(truth.annotations):
        place = f"$.annotations[{index}]"
        for key, number, known in (("image_id", entry.image_id, images), ("category_id", entry.category_id, names)):
            if number not in known:
                raise InputError(path, f"no entry has the id {number}", f"{place}.{key}")
        boxes[entry.image_id].append(
            (plain(names[entry.category_id].name), _box(path, entry, images[entry.image_id], place))
        )
    if not truth.annotations:
        raise InputError(path, "no boxes, expected at least one", "$.annotations")
    keys = _keys(images, frames, path)
    return {keys[number]: found for number, found in boxes.items()}


def no_box(name: str, labels: Collection[str]) -> str:
    """What to say of a class that none of the boxes has; ``labels`` are theirs."""
    return f"no box of class '{name}'; {near(name, labels) or 'it has ' + ', '.join(sorted(labels))}"


def categories(path: Path) -> list[str]:
    return [plain(entry.name) for entry in converted(path, load(path), Truth).categories]


Entry = TypeVar("Entry", Picture, Category)


def _by_id(path: Path, key: str, entries: list[Entry]) -> dict[int, Entry]:
    found = {entry.id: entry for entry in entries}
    if len(found) < len(entries):
        raise InputError(path, "two have the same id", f"$.{key}")
    return found


def _keys(images: Mapping[int, Picture], frames: Frames, path: Path) -> dict[int, int]:
    if frames == "number":
        return {number: number for number in images}
    if frames == "sample-time":
        keys = {number: image.sample_time for number, image in images.items() if image.sample_time is not None}
        if len(keys) < len(images):
            raise InputError(path, "an image has no sample_time, a whole number of us", "$.images")
        if len(set(keys.values())) < len(keys):
            raise InputError(path, "two have the same sample_time", "$.images")
        return keys
    if len(images) > 1:
        raise InputError(path, f"has {len(images)} images, expected one for all frames; see truth-frames", line=1)
    return dict.fromkeys(images, 0)


def _box(path: Path, entry: Annotation, image: Picture, place: str) -> Area:
    (x, y, wide, high), problem = entry.bbox, ""
    if entry.iscrowd:
        problem = "iscrowd is set, expected the box of one object"
    elif wide <= 0 or high <= 0:
        problem = f"has no area, {wide:g} x {high:g} pixels"
    elif x >= image.width or y >= image.height or x + wide <= 0 or y + high <= 0:
        problem = f"lies outside its image of {image.width} x {image.height} pixels"
    if problem:
        raise InputError(path, problem, f"{place}.bbox")
    return (x / image.width, y / image.height, wide / image.width, high / image.height)
