"""Counts of found, false and missed objects, and the measures made of them."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

from services.base import JudgedBoxes
from services.base.judged import LabelledArea, ScoredArea
from services.object_detection.boxes import LabelledBox, overlaps
from services.object_detection.mistakes import Frame, Mistakes, mistakes
from services.object_detection.pairing import best_pairs


@dataclass
class Counts:
    """True positives with the sum of their intersections over union, false positives, false negatives."""

    hits: int = 0
    false: int = 0
    missed: int = 0
    overlap: float = 0.0

    def add(self, other: "Counts") -> None:
        """Add other counts."""
        self.hits += other.hits
        self.false += other.false
        self.missed += other.missed
        self.overlap += other.overlap

    @property
    def precision(self) -> float | None:
        """Equation 4.3, TP / (TP + FP); None where nothing was detected."""
        return _ratio(self.hits, self.hits + self.false)

    @property
    def recall(self) -> float | None:
        """Equation 4.4, TP / (TP + FN); None where there was nothing to detect."""
        return _ratio(self.hits, self.hits + self.missed)

    @property
    def f1(self) -> float | None:
        """Equation 4.5, 2 TP / (2 TP + FP + FN); None where there was neither."""
        return _ratio(2 * self.hits, 2 * self.hits + self.false + self.missed)

    @property
    def mean_overlap(self) -> float | None:
        """The mean intersection over union of the hits."""
        return _ratio(self.overlap, self.hits)


@dataclass
class CountsByClass:
    """Counts by class, in the order in which classes came, and what kinds of mistakes they contain.

    Those of one frame have its ``boxes``.
    """

    by_label: dict[str, Counts] = field(default_factory=dict)
    mistakes: Mistakes = field(default_factory=Mistakes)
    boxes: JudgedBoxes = field(default=JudgedBoxes((), (), ()), compare=False, repr=False)

    def add(self, label: str, counts: Counts) -> None:
        """Add counts of a class."""
        self.by_label.setdefault(label, Counts()).add(counts)

    def __iter__(self) -> Iterator[tuple[str, Counts]]:
        return iter(self.by_label.items())

    def total(self) -> Counts:
        """The counts of all classes together."""
        total = Counts()
        for counts in self.by_label.values():
            total.add(counts)
        return total


def compare(
    found: Sequence[LabelledBox], true: Sequence[LabelledBox], threshold: float, labels: Collection[str]
) -> CountsByClass:
    """The counts of one frame. Boxes of a class pair up where they overlap by more than ``threshold``.

    Only classes in ``labels`` count, or all where it is empty.
    """
    result = CountsByClass()
    false, hit, missed = list[LabelledBox](), list[LabelledBox](), list[LabelledBox]()
    right = list[ScoredArea]()
    for label in dict.fromkeys(each.label for each in (*true, *found)):
        if labels and label not in labels:
            continue
        mine = [each for each in found if each.label == label]
        real = [each for each in true if each.label == label]
        scores = overlaps([each.box for each in mine], [each.box for each in real])
        pairs = best_pairs(scores, threshold)
        overlap = float(sum(scores[pair] for pair in pairs))
        result.add(label, Counts(len(pairs), len(mine) - len(pairs), len(real) - len(pairs), overlap))
        rows, columns = {row for row, _ in pairs}, {column for _, column in pairs}
        false += [each for row, each in enumerate(mine) if row not in rows]
        right += [(label, *mine[row].box, float(scores[row, column])) for row, column in pairs]
        for column, each in enumerate(real):
            (hit if column in columns else missed).append(each)
    result.mistakes = mistakes(Frame(false, hit, missed), threshold)
    result.boxes = JudgedBoxes(right, areas(false), areas(missed))
    return result


def areas(boxes: Sequence[LabelledBox]) -> list[LabelledArea]:
    """Boxes as they are recorded."""
    return [(label, *box) for label, box in boxes]


def _ratio(part: float, whole: int) -> float | None:
    return part / whole if whole else None
