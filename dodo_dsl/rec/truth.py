"""True boxes of one frame: marked manually or read from COCO JSON, checked, drawn, and written as COCO JSON.

Reference: cocodataset.org, "Data format", object detection; boxes are in pixels from the frame's upper left corner.
On disk a truth is the COCO file, its frame, and the same frame with the boxes drawn.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

from dodo_dsl import atomic
from dodo_dsl.opendlv import numbers, regular_file
from dodo_dsl.opendlv.assets import truth_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.picture_size import problem_of

if TYPE_CHECKING:
    from dodo_dsl.opendlv.pixels import Picture


_SLACK = 0.01
"""px by which a rounded box may reach over the frame's edge."""
_LEAST_SHOWN = 1000
"""px: a narrower frame is drawn at twice its size, as its boxes are small."""


class TruthError(ValueError):
    """Boxes that cannot be the truth of a frame; one sentence."""

    usage = True


class Mark(NamedTuple):
    """A box with its class; upper left corner and size in pixels."""

    label: str
    x: float
    y: float
    width: float
    height: float

    def __str__(self) -> str:
        return " ".join([self.label, *(f"{number:g}" for number in self[1:])])


def mark(label: object, values: Sequence[object], place: str) -> Mark:
    """A box of a class and its four numbers; raises TruthError, which names the position."""
    name = str(label).strip().removeprefix("color:").strip()
    if not name or not name.isprintable():
        raise TruthError(f"{place}: the class is empty or not printable")
    try:
        x, y, width, height = (numbers.number(str(each)) for each in values)
    except ValueError:
        x = y = width = height = math.nan
    if not all(map(math.isfinite, (x, y, width, height))):
        raise TruthError(f"{place}: expected a class and four numbers X Y WIDTH HEIGHT in pixels")
    return Mark(name, x, y, width, height)


def check(marks: Sequence[Mark], width: int, height: int, classes: Collection[str]) -> None:
    """Raises TruthError for the first box that a frame of this size cannot have; without classes any is allowed."""
    for number, each in enumerate(marks, 1):
        place = f"box {number} ({each})"
        if classes and each.label not in classes:
            raise TruthError(f"{place}: there is no class '{each.label}', expected one of {', '.join(classes)}")
        if each.width <= 0 or each.height <= 0:
            raise TruthError(f"{place}: has no area, expected a width and a height above 0")
        ends = each.x + each.width, each.y + each.height
        if min(each.x, each.y) < 0 or ends[0] > width + _SLACK or ends[1] > height + _SLACK:
            raise TruthError(f"{place}: lies outside the frame of {width} x {height} pixels")


def read(path: Path, width: int, height: int) -> list[Mark]:
    """The boxes of a COCO file of one frame of this size; raises TruthError."""
    fractions = boxes(path)
    size = truth_file.size(path)
    if size != (width, height):
        has = f"a frame of {size[0]} x {size[1]} pixels"
        raise TruthError(f"{path}: has boxes of {has}, expected one of {width} x {height} pixels")
    sides = (width, height, width, height)
    return [Mark(name, *(round(f * s, 6) for f, s in zip(box, sides, strict=True))) for name, box in fractions]


def boxes(path: Path) -> list[tuple[str, truth_file.Area]]:
    """The classes and boxes of a COCO file of one frame, as fractions of it; raises TruthError."""
    try:
        (found,) = truth_file.read(path, "one").values()
    except InputError as error:
        raise TruthError(str(error)) from None
    return found


def truth_text(marks: Sequence[Mark], picture: str, width: int, height: int) -> str:
    """COCO JSON of a frame's file name and size, and its boxes."""
    from dodo_dsl.rec.coco import DataSet

    images = [{"id": 1, "file_name": picture, "width": width, "height": height}]
    return DataSet(images, [(1, each.label, [round(number, 3) for number in each[1:]]) for each in marks]).text()


def drawn_boxes(picture: "Picture", marks: Sequence[Mark]) -> "Picture":
    """A frame (height, width, 3; B, G, R) with the boxes and their classes; twice as large if it is small."""
    import cv2

    scale = 2 if picture.shape[1] < _LEAST_SHOWN else 1
    shown: Picture = picture.repeat(scale, axis=0).repeat(scale, axis=1)
    colours = {label: _COLOURS[n % len(_COLOURS)] for n, label in enumerate(sorted({each.label for each in marks}))}
    for number, each in enumerate(marks, 1):
        corners = [round(scale * value) for value in (each.x, each.y, each.x + each.width, each.y + each.height)]
        first, last = (corners[0], corners[1]), (corners[2] - 1, corners[3] - 1)
        name, at = f"{number} {each.label}", (first[0], max(first[1] - 5, 12))
        for colour, thick in (((0, 0, 0), 3), (colours[each.label], 1)):
            cv2.rectangle(shown, first, last, colour, thick)
            cv2.putText(shown, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, thick, cv2.LINE_AA)
    return shown


_COLOURS = ((255, 80, 255), (255, 255, 60), (80, 255, 120), (255, 255, 255), (60, 160, 255))
"""B, G, R; none is the colour of a cone."""


MOST_FILE_BYTES = 64_000_000


@dataclass(frozen=True)
class TruthFiles:
    """The files of a truth: COCO, frame, and frame with boxes."""

    truth: Path
    picture: Path
    marked: Path

    @classmethod
    def beside(cls, path: Path) -> Self:
        """``FILE.json``, ``FILE.png`` and ``FILE-boxes.png``; raises TruthError for another ending."""
        if path.suffix != ".json":
            raise TruthError(f"--output is '{path}', expected a file that ends in .json")
        return cls(path, path.with_suffix(".png"), path.with_name(f"{path.stem}-boxes.png"))

    def wanted(self, has_boxes: bool, is_new: bool) -> list[Path]:
        """The files that will be written, for a frame that is ``is_new``."""
        return [*([self.truth, self.marked] if has_boxes else []), *([self.picture] if is_new else [])]

    def write(self, picture: "Picture", marks: Sequence[Mark], is_new: bool) -> None:
        """Writes the frames first, so that a reader that finds the truth finds them, too."""
        height, width = picture.shape[:2]
        if is_new:
            _write_picture(self.picture, picture)
        if marks:
            _write_picture(self.marked, drawn_boxes(picture, marks))
            atomic.write_text(self.truth, truth_text(marks, self.picture.name, width, height))


def given(path: Path) -> bytes:
    """The bytes of an existing frame; raises TruthError."""
    try:
        return regular_file.content(path, MOST_FILE_BYTES)
    except OSError as error:
        raise TruthError(f"{path}: cannot be read: {error.strerror}") from None


def decoded(data: bytes, name: str) -> "Picture":
    """The bytes of a frame as blue, green, red (height, width, 3); raises TruthError, which names it."""
    import cv2
    import numpy as np

    if problem := problem_of(data):
        raise TruthError(f"{name}: {problem}")
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise TruthError(f"{name}: not an image")
    return np.asarray(picture, np.uint8)


def _write_picture(target: Path, picture: "Picture") -> None:
    import cv2

    _, png = cv2.imencode(".png", picture)
    atomic.write_bytes(target, png.tobytes())
