"""True boxes from a file, by picture."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.opendlv.inputs import truth_file
from dodo_dsl.opendlv.inputs.truth_file import Frames, TruthFileError
from services.object_detection.boxes import Box, LabelledBox
from services.object_detection.frames import FrameKey

__all__ = ["Truth", "TruthFileError", "load"]


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
    """The truth in a file; raises TruthFileError."""
    found = truth_file.read(path, frames)
    pictures = {key: tuple(LabelledBox(label, Box(*area)) for label, area in boxes) for key, boxes in found.items()}
    return Truth(frames, pictures)
