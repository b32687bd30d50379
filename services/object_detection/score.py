"""How frames are judged: objects found, false or missed, silence, and the checks made of them.

Silence is which frames the application left without an answer, and for how long it said nothing.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from typing import NamedTuple

from services.base import Check, Flags, JudgedBoxes
from services.base.judged import LabelledArea, ScoredArea
from services.object_detection.boxes import LabelledBox, best_pairs, overlaps

SMALL = 0.6
"""Mean height of the missed objects to that of the found ones, below which size is the matter."""
OUTSIDE = 2.0
"""Fraction of the picture from which on a box is far outside of it."""
KINDS = {
    "far": "far outside the picture (are they in pixels?)",
    "misnamed": "on objects of another class",
    "doubled": "on objects that others found",
    "loose": "beside objects or around them",
    "nowhere": "where nothing is",
}


def _kind(detection: LabelledBox, hit: Sequence[LabelledBox], missed: Sequence[LabelledBox], threshold: float) -> str:
    """Of a false detection; ``threshold`` is the overlap that a hit needs."""
    if max(map(abs, detection.box)) > OUTSIDE:
        return "far"
    true = [*hit, *missed]
    agreed = overlaps([detection.box], [each.box for each in true])[0].tolist()
    near = [each for each, score in zip(true, agreed, strict=True) if score > threshold]
    if any(each.label != detection.label for each in near):
        return "misnamed"
    if any(each in hit for each in near):
        return "doubled"
    return "loose" if any(agreed) else "nowhere"


@dataclass
class Counts:
    """True positives with the sum of their intersections over union, false positives, false negatives."""

    hits: int = 0
    false: int = 0
    missed: int = 0
    overlap: float = 0.0

    def add(self, other: "Counts") -> None:
        self.hits += other.hits
        self.false += other.false
        self.missed += other.missed
        self.overlap += other.overlap

    @property
    def mistakes(self) -> int:
        return self.false + self.missed

    @property
    def precision(self) -> float | None:
        """Equation 4.3, TP / (TP + FP); None if nothing was detected."""
        return _ratio(self.hits, self.hits + self.false)

    @property
    def recall(self) -> float | None:
        """Equation 4.4, TP / (TP + FN); None if there was nothing to detect."""
        return _ratio(self.hits, self.hits + self.missed)

    @property
    def f1(self) -> float | None:
        """Equation 4.5, 2 TP / (2 TP + FP + FN); None if there was neither."""
        return _ratio(2 * self.hits, 2 * self.hits + self.false + self.missed)

    @property
    def mean_overlap(self) -> float | None:
        return _ratio(self.overlap, self.hits)


@dataclass
class CountsByClass:
    """Counts by class, in the order in which classes came, and of false detections by KINDS.

    ``missed`` and ``found`` are heights of objects, in fractions of the picture's.
    Those of one frame have its ``boxes``.
    """

    by_label: dict[str, Counts] = field(default_factory=dict)
    kinds: Counter[str] = field(default_factory=Counter, compare=False)
    missed: list[float] = field(default_factory=list, compare=False)
    found: list[float] = field(default_factory=list, compare=False)
    boxes: JudgedBoxes = field(default=JudgedBoxes((), (), ()), compare=False, repr=False)

    def add(self, label: str, counts: Counts) -> None:
        self.by_label.setdefault(label, Counts()).add(counts)

    def __iter__(self) -> Iterator[tuple[str, Counts]]:
        return iter(self.by_label.items())

    def total(self) -> Counts:
        total = Counts()
        for counts in self.by_label.values():
            total.add(counts)
        return total


def compare(
    found: Sequence[LabelledBox], true: Sequence[LabelledBox], threshold: float, labels: Collection[str]
) -> CountsByClass:
    """The counts of one frame. Boxes of a class pair up where they overlap by more than ``threshold``.

    Only classes in ``labels`` count, or all if it is empty.
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
    result.kinds.update(_kind(each, hit, missed, threshold) for each in false)
    result.missed, result.found = ([each.box.height for each in boxes] for boxes in (missed, hit))
    result.boxes = JudgedBoxes(right, areas(false), areas(missed))
    return result


def areas(boxes: Sequence[LabelledBox]) -> list[LabelledArea]:
    return [(label, *box) for label, box in boxes]


def _ratio(part: float, whole: int) -> float | None:
    return part / whole if whole else None


class JudgedFrame(NamedTuple):
    """A frame by its ``order`` among others, its ``place`` in sentences, and what identifies it in the evidence.

    ``answered`` in s of the test, None for no answer; ``counts`` are of all its classes.
    """

    order: int
    place: str
    key: Mapping[str, float]
    answered: float | None
    counts: Counts

    @property
    def expects(self) -> bool:
        """Whether it has true boxes that count, and so expects an answer."""
        return bool(self.counts.hits + self.counts.missed)


class Unanswered(NamedTuple):
    """How many of the frames that expect an answer have none, and the longest run of those, by its ends."""

    frames: int
    silent: int
    longest: tuple[JudgedFrame, ...] = ()

    @property
    def share(self) -> float | None:
        """Of all frames that expect an answer; None if none does."""
        return self.silent / self.frames if self.frames else None


class Gap(NamedTuple):
    """A time without an answer, in s of the test; for ``hidden`` s of it nothing was shown, which do not count."""

    begin: float
    end: float
    hidden: float = 0.0

    @property
    def length(self) -> float:
        return self.end - self.begin - self.hidden


@dataclass
class Silence:
    """Collects judged frames and the times (s) of answers; the first may come within ``start_up`` s."""

    start_up: float = 0.0
    frames: list[JudgedFrame] = field(default_factory=list)
    answers: list[float] = field(default_factory=list)

    def unanswered(self) -> Unanswered:
        """Frames without an answer; those from before a first answer within the start-up are left out."""
        frames = sorted(self.frames, key=lambda frame: frame.order)
        first = next((i for i, frame in enumerate(frames) if frame.answered is not None), None)
        if first is not None and (frames[first].answered or 0.0) <= self.start_up:
            frames = frames[first:]
        frames = [frame for frame in frames if frame.expects or frame.answered is not None]
        groups = groupby(frames, key=lambda frame: frame.answered is None)
        runs = [tuple(group) for is_silent, group in groups if is_silent]
        return Unanswered(len(frames), sum(map(len, runs)), max(runs, key=len, default=()))

    def gap(self, begin: float, end: float, hidden: Callable[[float, float], float] = lambda _a, _b: 0.0) -> Gap:
        """The longest time without an answer, of that from ``begin`` to ``end`` in s."""
        times: Sequence[float] = sorted(time for time in self.answers if begin <= time <= end)
        if times and times[0] <= self.start_up:
            begin = times[0]
        parts = pairwise([begin, *times, max(begin, end)])
        return max((Gap(a, b, hidden(a, b)) for a, b in parts), key=lambda gap: gap.length)


MEASURES = ("precision", "recall", "f1")
MOST_CLASSES = 20
"""So many classes that only the application names have checks: the runner reads lines of 64 KiB."""


@dataclass
class Score:
    """Counts of the judged frames, and what was left out.

    The application sent something on ``answered`` of the ``frames``, and left some ``unanswered`` of those that expect
    an answer; its longest silence is the ``gap``. Left out were frames ``without_truth``, and
    detections that were ``late`` or ``repeated`` a detectionId.
    """

    counts: CountsByClass = field(default_factory=CountsByClass)
    frames: int = 0
    answered: int = 0
    without_truth: int = 0
    late: int = 0
    early: int = 0
    repeated: int = 0
    worst: JudgedFrame | None = None
    """The frame with the most mistakes."""
    unanswered: Unanswered = field(default_factory=lambda: Unanswered(0, 0))
    gap: Gap | None = None

    def add(self, frame: JudgedFrame, found: CountsByClass) -> None:
        """Add a frame, and its counts by class."""
        self.frames += 1
        self.answered += frame.answered is not None
        for label, counts in found:
            self.counts.add(label, counts)
        self.counts.kinds += found.kinds
        self.counts.missed += found.missed
        self.counts.found += found.found
        if frame.counts.mistakes > (self.worst.counts.mistakes if self.worst else 0):
            self.worst = frame

    def evidence(self) -> dict[str, float | str | None]:
        """The worst frame with its counts, and the longest silence; times in s of the test."""
        worst, gap = self.worst, self.gap
        counts = worst and {"found": worst.counts.hits, "false": worst.counts.false, "missed": worst.counts.missed}
        return {
            **({**worst.key, **counts} if worst and counts else {}),
            **({"gap-begin": gap.begin, "gap-end": gap.end} if gap else {}),
        }

    def checks(self, flags: Flags) -> tuple[Check, ...]:
        """Totals, what was counted, and a line of measures for each class; a measure without a value keeps no limit."""
        total = self.counts.total()
        counts = {
            "true-positives": total.hits,
            "false-positives": total.false,
            "false-negatives": total.missed,
            "mean-iou": total.mean_overlap,
            "frames": self.frames,
        }
        gap = Check.most("gap", self.gap.length if self.gap else None, flags["max-gap"], "s")
        silent = Check.most("unanswered", self.unanswered.share, flags["max-unanswered"])
        left_out = {"without-truth": self.without_truth, "late": self.late, "repeated": self.repeated}
        return (
            *(Check.least(name, getattr(total, name), flags[f"min-{name}"]) for name in MEASURES),
            *(Check(name, value) for name, value in counts.items()),
            Check.least("answered", self.answered, flags["min-frames"], parameters=("min-frames",)),
            silent if self.unanswered.frames else replace(silent, ok=True),  # no answer was expected
            gap if self.gap else replace(gap, ok=True),
            *(Check(name, value) for name, value in left_out.items()),
            *self._classes(flags),
        )

    def _classes(self, flags: Flags) -> Iterator[Check]:
        made_up = [label for label, counts in self.counts if not counts.hits + counts.missed]
        for label, counts in self.counts:
            for name in MEASURES if label not in made_up[MOST_CLASSES:] else ():
                limit = flags[f"min-{name}"] if flags["each-class"] else None
                yield Check.least(
                    f"{name}-{label or 'unnamed'}", getattr(counts, name), limit, parameters=(f"min-{name}",)
                )
