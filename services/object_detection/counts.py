"""What was found, what was false and what was missed, and what that is worth."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

from services.object_detection.boxes import Thing, overlaps
from services.object_detection.pairing import best_pairs


@dataclass
class Tally:
    """True positives with the sum of their intersections over union, false positives, false negatives."""

    hits: int = 0
    false: int = 0
    missed: int = 0
    overlap: float = 0.0

    def add(self, other: "Tally") -> None:
        """Take in another's counts."""
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
class Tallies:
    """A tally a class, in the order in which classes came."""

    by_label: dict[str, Tally] = field(default_factory=dict)

    def add(self, label: str, tally: Tally) -> None:
        """Take in the counts of a class."""
        self.by_label.setdefault(label, Tally()).add(tally)

    def __iter__(self) -> Iterator[tuple[str, Tally]]:
        return iter(self.by_label.items())

    def total(self) -> Tally:
        """The counts of all classes together."""
        total = Tally()
        for tally in self.by_label.values():
            total.add(tally)
        return total


def compare(found: Sequence[Thing], true: Sequence[Thing], threshold: float, labels: Collection[str]) -> Tallies:
    """The tallies of one frame. Boxes of a class pair up where they overlap by more than `threshold`.

    Only classes in `labels` count, or all where it is empty.
    """
    result = Tallies()
    for label in dict.fromkeys(thing.label for thing in (*true, *found)):
        if labels and label not in labels:
            continue
        mine = [thing.box for thing in found if thing.label == label]
        real = [thing.box for thing in true if thing.label == label]
        scores = overlaps(mine, real)
        pairs = best_pairs(scores, threshold)
        overlap = float(sum(scores[pair] for pair in pairs))
        result.add(label, Tally(len(pairs), len(mine) - len(pairs), len(real) - len(pairs), overlap))
    return result


def _ratio(part: float, whole: int) -> float | None:
    return part / whole if whole else None
