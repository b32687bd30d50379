"""The messages of a frame, put together to boxes with classes."""

from dataclasses import dataclass, field
from typing import NamedTuple

from services.object_detection.boxes import Box, Thing

PREFIX = "color:"


class Mark(NamedTuple):
    """Which frame a message is about: its sample time (microseconds), and the sampleId that came with it."""

    time: int
    number: int


class Kind(NamedTuple):
    """The class of a detection by its DetectionType alone."""

    number: int


Value = Box | str | Kind
"""What a message says of a detection: DetectionBoundingBox, DetectionProperty or DetectionType."""


@dataclass
class Parts:
    """What one sender said of the detections in a frame, by detectionId; of each the first word counts."""

    boxes: dict[int, Box] = field(default_factory=dict)
    labels: dict[int, str] = field(default_factory=dict)
    kinds: dict[int, Kind] = field(default_factory=dict)
    repeated: int = 0

    def add(self, number: int, value: Value) -> None:
        """One message; boxes under a detectionId that is taken are counted in `repeated`."""
        if isinstance(value, Box):
            self.repeated += number in self.boxes
            self.boxes.setdefault(number, value)
        elif isinstance(value, Kind):
            self.kinds.setdefault(number, value)
        else:
            self.labels.setdefault(number, plain(value))

    def things(self) -> list[Thing]:
        """The boxes, with their property as class, or else `type N`, or else none."""
        return [Thing(self._label(number), box) for number, box in self.boxes.items()]

    def _label(self, number: int) -> str:
        if label := self.labels.get(number):
            return label
        return f"type {self.kinds[number].number}" if number in self.kinds else ""

    def __bool__(self) -> bool:
        return bool(self.boxes or self.labels or self.kinds)


@dataclass
class Frame:
    """A frame of which something was heard, for the first time at `since` (microseconds of test time).

    `told` is whether the truth of this frame is known to be complete, `answered` whether the application spoke of it.
    """

    mark: Mark
    since: int
    found: Parts = field(default_factory=Parts)
    true: Parts = field(default_factory=Parts)
    told: bool = False
    answered: bool = False


def plain(label: str) -> str:
    """A class without `color:` and blanks around it."""
    return label.strip().removeprefix(PREFIX).strip()
