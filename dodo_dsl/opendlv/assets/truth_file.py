"""True boxes from a file in the COCO format (cocodataset.org, "Data format", object detection), in pixels."""

import difflib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets import json_file
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


class TruthFileError(InputError):
    """A truth that cannot be used; the message names file and position."""


@dataclass(frozen=True)
class FileEntry:
    """An entry of a file."""

    path: Path
    name: str

    def fail(self, what: str, inner: str = "") -> NoReturn:
        raise TruthFileError(self.path, what, self.name + inner)


def plain(label: str) -> str:
    """A class without ``color:`` and blanks around it."""
    return label.strip().removeprefix(PREFIX).strip()


def read(path: Path, frames: Frames) -> dict[int, list[tuple[str, Area]]]:
    """The classes and boxes of each image, by what distinguishes images; raises TruthFileError."""
    document = _document(path)
    images = {_whole(entry, "id", place): (entry, place) for entry, place in _entries(document, "images", path)}
    if len(images) != len(document["images"]):
        raise TruthFileError(path, "two have the same id", "images")
    names = {_whole(entry, "id", place): _name(entry, place) for entry, place in _entries(document, "categories", path)}
    if len(names) != len(document["categories"]):
        raise TruthFileError(path, "two have the same id", "categories")
    boxes: dict[int, list[tuple[str, Area]]] = {number: [] for number in images}
    for entry, place in _entries(document, "annotations", path):
        image, category = _known(entry, "image_id", images, place), _known(entry, "category_id", names, place)
        boxes[image].append((names[category], _box(entry, images[image], place)))
    if not any(boxes.values()):
        raise TruthFileError(path, "no boxes, expected at least one", "annotations")
    keys = _keys(images, frames, path)
    return {keys[number]: found for number, found in boxes.items()}


def size(path: Path) -> tuple[int, int]:
    """Width and height in pixels of the only image of a file that was read."""
    (image,) = _document(path)["images"]
    return image["width"], image["height"]


def corners(path: Path) -> Iterator[TruthFileError]:
    """The first box that ends far outside its image, as one does that is written as two corners; the file is read."""
    document = _document(path)
    images = {entry["id"]: entry for entry in document["images"]}
    for index, entry in enumerate(document["annotations"]):
        image, (x, y, wide, high) = images[entry["image_id"]], entry["bbox"]
        beyond = max((x + wide) / image["width"], (y + high) / image["height"])
        is_corners = x < wide <= image["width"] and y < high <= image["height"]
        if beyond > (_FAR if is_corners else _FARTHER):
            what = f"the box ends at {x + wide:g}, {y + high:g}, outside its image of {image['width']} x "
            what += f"{image['height']} pixels"
            hint = "a box is [x, y, width, height]"
            hint += f": the one with these corners is {[x, y, wide - x, high - y]}" if is_corners else ""
            yield TruthFileError(path, what, f"annotations[{index}].bbox", hint=hint, is_slip=True)
            return


def unread_keys(path: Path) -> Iterator[InputError]:
    """Keys that are none of the format, each once; the file is read."""
    document = _document(path)
    for kind, known in _KEYS.items():
        entries = {f"$.{kind}[{n}]": entry for n, entry in enumerate(document[kind])} if kind else {"$": document}
        yield from json_file.unread([json_file.Node(path, *entry) for entry in entries.items()], sorted(known))


def no_box(name: str, labels: Collection[str]) -> str:
    """What to say of a class that none of the boxes has; ``labels`` are theirs."""
    close = difflib.get_close_matches(name, labels, n=1)
    hint = f"did you mean '{close[0]}'?" if close else f"it has {', '.join(sorted(labels))}"
    return f"no box of class '{name}'; {hint}"


def categories(path: Path) -> list[str]:
    """The classes that a file names, whether a box has them or not; raises TruthFileError."""
    return [_name(entry, place) for entry, place in _entries(_document(path), "categories", path)]


def _document(path: Path) -> Any:
    try:
        return json_file.loads(regular_file.text(path))
    except json_file.JsonError as error:
        raise TruthFileError(path, error.what, line=error.line, column=error.column, hint=error.hint) from None
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        what = f"cannot be read as COCO JSON: {reason}"
        raise TruthFileError(path, what, sentence=f"{path}: {what}") from None


def _entries(document: Any, name: str, path: Path) -> Sequence[tuple[dict[str, Any], FileEntry]]:
    entries = document.get(name) if isinstance(document, dict) else None
    if not isinstance(entries, list):
        raise TruthFileError(path, f"expected an object with a list '{name}'")
    places = [FileEntry(path, f"{name}[{index}]") for index in range(len(entries))]
    for entry, place in zip(entries, places, strict=True):
        if not isinstance(entry, dict):
            place.fail("expected an object")
    return list(zip(entries, places, strict=True))


def _keys(images: Mapping[int, tuple[Any, FileEntry]], frames: Frames, path: Path) -> dict[int, int]:
    """Each image's key, by its id."""
    if frames == "number":
        return {number: number for number in images}
    if frames == "sample-time":
        keys = {number: _whole(entry, "sample_time", place) for number, (entry, place) in images.items()}
        if len(set(keys.values())) < len(keys):
            raise TruthFileError(path, "two have the same sample_time", "images")
        return keys
    if len(images) > 1:
        raise TruthFileError(
            path,
            f"has {len(images)} images, expected one for all frames; see truth-frames",
            line=1,
            sentence=f"{path}: has {len(images)} images, expected one for all frames; see truth-frames",
        )
    return dict.fromkeys(images, 0)


def _box(entry: dict[str, Any], image: tuple[dict[str, Any], FileEntry], place: FileEntry) -> Area:
    """The box as fractions of its image."""
    if entry.get("iscrowd"):
        place.fail("iscrowd is set, expected the box of one object")
    width, height = (_whole(image[0], side, image[1], 1) for side in ("width", "height"))
    numbers = entry.get("bbox")
    if not isinstance(numbers, list) or len(numbers) != 4 or not all(map(_is_number, numbers)):
        place.fail("expected four numbers [x, y, width, height] in pixels", ".bbox")
    x, y, wide, high = map(float, numbers)
    if wide <= 0 or high <= 0:
        place.fail(f"has no area, {wide:g} x {high:g} pixels", ".bbox")
    if x >= width or y >= height or x + wide <= 0 or y + high <= 0:
        place.fail(f"lies outside its image of {width} x {height} pixels", ".bbox")
    return (x / width, y / height, wide / width, high / height)


def _name(entry: dict[str, Any], place: FileEntry) -> str:
    name = entry.get("name")
    if not isinstance(name, str) or not plain(name):
        place.fail("expected a string", ".name")
    return plain(name)


def _known(entry: dict[str, Any], key: str, known: Mapping[int, object], place: FileEntry) -> int:
    number = _whole(entry, key, place)
    if number not in known:
        place.fail(f"no entry has the id {number}", f".{key}")
    return number


def _whole(entry: dict[str, Any], key: str, place: FileEntry, least: int = 0) -> int:
    value = entry.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < LARGEST:
        place.fail(f"expected a whole number, {least} or more", f".{key}")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -LARGEST < value < LARGEST
