"""What kind of mistakes an application makes, so that a verdict can say what is wrong."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from services.object_detection.boxes import Box, LabelledBox, overlaps

OUTSIDE = 2.0
"""Fraction of the picture from which on a box is far outside of it."""
SMALL = 0.6
"""Mean height of the missed objects to that of the found ones, below which size is the matter."""
KINDS = {
    "far": "far outside the picture (are they in pixels?)",
    "misnamed": "on objects of another class",
    "doubled": "on objects that others found",
    "loose": "beside objects or around them",
    "nowhere": "where nothing is",
}


@dataclass
class Mistakes:
    """False detections by KINDS, and heights of missed and found objects in fractions of the picture."""

    kinds: Counter[str] = field(default_factory=Counter)
    missed: list[float] = field(default_factory=list)
    found: list[float] = field(default_factory=list)

    def add(self, other: "Mistakes") -> None:
        """Add those of another frame."""
        self.kinds.update(other.kinds)
        self.missed.extend(other.missed)
        self.found.extend(other.found)

    @property
    def sentence(self) -> str:
        """Where the false detections are, and whether small objects are missed; empty without mistakes."""
        places = [f"{count} {KINDS[kind]}" for kind, count in self.kinds.most_common()]
        where = f"false detections: {', '.join(places)}" if places else ""
        missed, found = (sum(heights) / max(1, len(heights)) for heights in (self.missed, self.found))
        sizes = f"{missed:.2g} of the picture's height on average, and found ones {found:.2g}"
        size = f"missed objects are small: {sizes}" if 0.0 < missed < SMALL * found else ""
        return "; ".join(part for part in (where, size) if part)


@dataclass(frozen=True)
class Frame:
    """The boxes of a frame: false detections, and true ones that were hit or missed."""

    false: Sequence[LabelledBox]
    hit: Sequence[LabelledBox]
    missed: Sequence[LabelledBox]


def mistakes(frame: Frame, threshold: float) -> Mistakes:
    """The mistakes of one frame; ``threshold`` is the overlap that a hit needs."""
    kinds = Counter(_kind(each, frame, threshold) for each in frame.false)
    return Mistakes(kinds, [each.box.height for each in frame.missed], [each.box.height for each in frame.hit])


def _kind(detection: LabelledBox, frame: Frame, threshold: float) -> str:
    if max(abs(value) for value in detection.box) > OUTSIDE:
        return "far"
    true = [*frame.hit, *frame.missed]
    others = [each.box for each in true if each.label != detection.label]
    if _overlap(detection.box, others) > threshold:
        return "misnamed"
    if _overlap(detection.box, [each.box for each in frame.hit if each.label == detection.label]) > threshold:
        return "doubled"
    return "loose" if _overlap(detection.box, [each.box for each in true]) > 0.0 else "nowhere"


def _overlap(box: Box, others: Collection[Box]) -> float:
    return float(overlaps([box], list(others)).max(initial=0.0))
