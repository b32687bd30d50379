"""The messages of a frame, combined into boxes with classes."""

from dataclasses import dataclass, field
from typing import NamedTuple

from dodo_dsl.opendlv.inputs.truth_file import plain
from services.object_detection.boxes import Box, LabelledBox


class FrameKey(NamedTuple):
    """Which frame a message is about: its sample time (microseconds), and the sampleId that came with it."""

    time: int
    number: int


class TypeNumber(NamedTuple):
    """The class of a detection by its DetectionType alone."""

    number: int


Value = Box | str | TypeNumber
"""The content of a message: DetectionBoundingBox, DetectionProperty or DetectionType."""


@dataclass
class Detections:
    """One sender's messages on a frame, by detectionId; the first of each kind counts."""

    boxes: dict[int, Box] = field(default_factory=dict)
    labels: dict[int, str] = field(default_factory=dict)
    types: dict[int, TypeNumber] = field(default_factory=dict)
    repeated: int = 0

    def add(self, number: int, value: Value) -> None:
        """One message; boxes under a detectionId that is in use are counted in ``repeated``."""
        if isinstance(value, Box):
            self.repeated += number in self.boxes
            self.boxes.setdefault(number, value)
        elif isinstance(value, TypeNumber):
            self.types.setdefault(number, value)
        else:
            self.labels.setdefault(number, plain(value))

    def labelled(self) -> list[LabelledBox]:
        """The boxes, each with its property as class, or else ``type N``, or else none."""
        return [LabelledBox(self._label(number), box) for number, box in self.boxes.items()]

    def _label(self, number: int) -> str:
        if label := self.labels.get(number):
            return label
        return f"type {self.types[number].number}" if number in self.types else ""

    def __bool__(self) -> bool:
        return bool(self.boxes or self.labels or self.types)


@dataclass
class DetectedFrame:
    """A frame with at least one message, the first at ``since`` (microseconds of test time).

    ``has_truth``: its truth is known to be complete, even if empty; ``answered``: when the application first sent
    something, in s of the test.
    """

    key: FrameKey
    since: int
    found: Detections = field(default_factory=Detections)
    true: Detections = field(default_factory=Detections)
    has_truth: bool = False
    answered: float | None = None
