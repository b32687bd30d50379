"""A truth on disk: the COCO file, its picture, and the same picture with the boxes drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.video.picture_size import problem_of
from dodo_dsl.rec import truth
from dodo_dsl.rec.truth import Mark, TruthError

if TYPE_CHECKING:
    from dodo_dsl.opendlv.memory.pixels import Picture

MOST_BYTES = 64_000_000


@dataclass(frozen=True)
class TruthFiles:
    """The files of a truth: COCO, picture, and picture with boxes."""

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
        """The files that will be written, for a picture that is ``is_new``."""
        return [*([self.truth, self.marked] if has_boxes else []), *([self.picture] if is_new else [])]

    def write(self, picture: "Picture", marks: Sequence[Mark], is_new: bool) -> None:
        """Writes the pictures first, so that whoever finds the truth finds them, too."""
        height, width = picture.shape[:2]
        if is_new:
            _write_picture(self.picture, picture)
        if marks:
            _write_picture(self.marked, truth.drawn(picture, marks))
            atomic.write_text(self.truth, truth.text(marks, self.picture.name, width, height))


def given(path: Path) -> bytes:
    """The bytes of an existing picture; raises TruthError."""
    try:
        return regular_file.content(path, MOST_BYTES)
    except OSError as error:
        raise TruthError(f"{path}: cannot be read: {error.strerror}") from None


def decoded(data: bytes, name: str) -> "Picture":
    """The bytes of a picture as blue, green, red (height, width, 3); raises TruthError, which names it."""
    import cv2
    import numpy as np

    if problem := problem_of(data):
        raise TruthError(f"{name}: {problem}")
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise TruthError(f"{name}: not a picture")
    return np.asarray(picture, np.uint8)


def _write_picture(target: Path, picture: "Picture") -> None:
    import cv2

    _, png = cv2.imencode(".png", picture)
    atomic.write_bytes(target, png.tobytes())
