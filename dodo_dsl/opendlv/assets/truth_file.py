"""True boxes from a file in the COCO format (cocodataset.org, "Data format", object detection), in pixels."""

import difflib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from dodo_dsl.opendlv.assets.json_file import Node, unread
from dodo_dsl.opendlv.assets.problem import InputError

Frames = Literal["one", "sample-time", "number"]
Area = tuple[float, float, float, float]
"""x, y, width and height as fractions of the image."""


LARGEST = 2**63
_FAR, _FARTHER = 1.1, 1.5
"""Times the image, up to which boxes may go on outside it: those that could be corners, and others."""
PREFIX = "color:"
_KEYS: Mapping[str, frozenset[str]] = {
    "": frozenset(("info", "licenses", "images", "annotations", "categories")),
    "images": frozenset(("id", "width", "height", "file_name", "license", "sample_time"))
    | {"flickr_url", "coco_url", "date_captured"},
    "annotations": frozenset(("id", "image_id", "category_id", "segmentation", "area", "bbox", "iscrowd")),
    "categories": frozenset(("id", "name", "supercategory")),
}
"""The format's keys at the top and in the entries of each list, and DoDo's ``sample_time``."""


class NoBoxes(InputError):
    """A truth without a single box."""


def plain(label: str) -> str:
    """A class without ``color:`` and blanks around it."""
    return label.strip().removeprefix(PREFIX).strip()


def read(path: Path, frames: Frames) -> dict[int, list[tuple[str, Area]]]:
    """The classes and boxes of each image, by what distinguishes images; raises InputError."""
    root = Node.load(path)
    images = _by_id(root, "images")
    names = {number: _name(entry) for number, entry in _by_id(root, "categories").items()}
    boxes: dict[int, list[tuple[str, Area]]] = {number: [] for number in images}
    for entry in _objects(root, "annotations"):
        image, category = _known(entry, "image_id", images), _known(entry, "category_id", names)
        boxes[image].append((names[category], _box(entry, images[image])))
    if not any(boxes.values()):
        raise NoBoxes(path, "no boxes, expected at least one", "$.annotations")
    keys = _keys(images, frames, path)
    return {keys[number]: found for number, found in boxes.items()}


def corners(path: Path) -> Iterator[InputError]:
    """The first box that ends far outside its image, as one does that is written as two corners; the file is read."""
    root = Node.load(path)
    images = _by_id(root, "images")
    for entry in _objects(root, "annotations"):
        image, (x, y, wide, high) = images[entry.value["image_id"]].value, entry.value["bbox"]
        beyond = max((x + wide) / image["width"], (y + high) / image["height"])
        is_corners = x < wide <= image["width"] and y < high <= image["height"]
        if beyond > (_FAR if is_corners else _FARTHER):
            what = f"the box ends at {x + wide:g}, {y + high:g}, outside its image of {image['width']} x "
            what += f"{image['height']} pixels"
            hint = "a box is [x, y, width, height]"
            hint += f": the one with these corners is {[x, y, wide - x, high - y]}" if is_corners else ""
            yield InputError(path, what, f"{entry.place}.bbox", hint=hint, is_slip=True)
            return


def unread_keys(path: Path) -> Iterator[InputError]:
    """Keys that are none of the format, each once; the file is read."""
    root = Node.load(path)
    for kind, known in _KEYS.items():
        yield from unread(root.items(kind) if kind else [root], sorted(known))


def no_box(name: str, labels: Collection[str]) -> str:
    """What to say of a class that none of the boxes has; ``labels`` are theirs."""
    close = difflib.get_close_matches(name, labels, n=1)
    hint = f"did you mean '{close[0]}'?" if close else f"it has {', '.join(sorted(labels))}"
    return f"no box of class '{name}'; {hint}"


def categories(path: Path) -> list[str]:
    """The classes that a file names, whether a box has them or not; raises InputError."""
    return [_name(entry) for entry in _objects(Node.load(path), "categories")]


def _objects(root: Node, name: str) -> Iterator[Node]:
    root.required(name)
    for entry in root.items(name):
        if not isinstance(entry.value, dict):
            entry.fail("an object")
        yield entry


def _by_id(root: Node, name: str) -> dict[int, Node]:
    entries = list(_objects(root, name))
    found = {_whole(entry, "id"): entry for entry in entries}
    if len(found) < len(entries):
        raise InputError(root.file, "two have the same id", f"$.{name}")
    return found


def _keys(images: Mapping[int, Node], frames: Frames, path: Path) -> dict[int, int]:
    """Each image's key, by its id."""
    if frames == "number":
        return {number: number for number in images}
    if frames == "sample-time":
        keys = {number: _whole(entry, "sample_time") for number, entry in images.items()}
        if len(set(keys.values())) < len(keys):
            raise InputError(path, "two have the same sample_time", "$.images")
        return keys
    if len(images) > 1:
        what = f"has {len(images)} images, expected one for all frames; see truth-frames"
        raise InputError(path, what, line=1)
    return dict.fromkeys(images, 0)


def _box(entry: Node, image: Node) -> Area:
    """The box as fractions of its image."""
    if entry.value.get("iscrowd"):
        raise InputError(entry.file, "iscrowd is set, expected the box of one object", entry.place)
    width, height = (_whole(image, side, 1) for side in ("width", "height"))
    numbers, place = entry.value.get("bbox"), f"{entry.place}.bbox"
    if not isinstance(numbers, list) or len(numbers) != 4 or not all(map(_is_number, numbers)):
        Node(entry.file, place, numbers).fail("four numbers [x, y, width, height] in pixels")
    x, y, wide, high = map(float, numbers)
    if wide <= 0 or high <= 0:
        raise InputError(entry.file, f"has no area, {wide:g} x {high:g} pixels", place)
    if x >= width or y >= height or x + wide <= 0 or y + high <= 0:
        raise InputError(entry.file, f"lies outside its image of {width} x {height} pixels", place)
    return (x / width, y / height, wide / width, high / height)


def _name(entry: Node) -> str:
    name = entry.value.get("name")
    if not isinstance(name, str) or not plain(name):
        Node(entry.file, f"{entry.place}.name", name).fail("a string")
    return plain(name)


def _known(entry: Node, key: str, known: Mapping[int, object]) -> int:
    number = _whole(entry, key)
    if number not in known:
        raise InputError(entry.file, f"no entry has the id {number}", f"{entry.place}.{key}")
    return number


def _whole(entry: Node, key: str, least: int = 0) -> int:
    value = entry.value.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < LARGEST:
        Node(entry.file, f"{entry.place}.{key}", value).fail(f"a whole number, {least} or more")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -LARGEST < value < LARGEST
