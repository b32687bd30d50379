"""How frames are judged, what is counted over all of them, and the checks made of it."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from services.base import Check
from services.object_detection.counts import Counts, CountsByClass
from services.object_detection.silence import Gap, Unanswered

MEASURES = ("precision", "recall", "f1")


@dataclass(frozen=True)
class Rules:
    """How frames are judged: overlap needed, classes that count (all when empty), and times in seconds.

    Frames from before ``start`` do not count. A frame is judged ``max_delay`` after its first message. The first
    answer may come within ``start_up``.
    """

    iou: float
    labels: Collection[str]
    max_delay: float
    max_time: float
    start: float = 0.0
    start_up: float = 0.0


@dataclass(frozen=True)
class DetectionLimits:
    """The least required values, None for no limit; ``each_class`` applies them to every class, too.

    At most a share of ``unanswered`` frames, and ``gap`` s without an answer; None for no limit.
    """

    precision: float | None = None
    recall: float | None = None
    f1: float | None = None
    frames: int = 1
    each_class: bool = False
    unanswered: float | None = None
    gap: float | None = None

    def of(self, measure: str) -> float | None:
        """The limit of one of MEASURES."""
        limit: float | None = getattr(self, measure)
        return limit


@dataclass(frozen=True)
class WorstFrame:
    """The frame with the most mistakes, where it was, and what was wrong; ``key`` identifies it in the evidence."""

    place: str
    counts: Counts
    key: Mapping[str, float] = field(default_factory=dict)

    @property
    def mistakes(self) -> int:
        """False and missed ones together."""
        return self.counts.false + self.counts.missed


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
    worst: WorstFrame | None = None
    unanswered: Unanswered = field(default_factory=lambda: Unanswered(0, 0))
    gap: Gap | None = None

    def add(
        self, frame: CountsByClass, place: str, answered: bool, key: Mapping[str, float] = MappingProxyType({})
    ) -> None:
        """Add a frame's counts; ``place`` names it in sentences, ``key`` in the evidence."""
        self.frames += 1
        self.answered += answered
        for label, counts in frame:
            self.counts.add(label, counts)
        self.counts.mistakes.add(frame.mistakes)
        worst = WorstFrame(place, frame.total(), key)
        if worst.mistakes > (self.worst.mistakes if self.worst else 0):
            self.worst = worst

    def evidence(self) -> dict[str, float | str | None]:
        """The worst frame with its counts, and the longest silence; times in s of the test."""
        worst, gap = self.worst, self.gap
        counts = worst and {"found": worst.counts.hits, "false": worst.counts.false, "missed": worst.counts.missed}
        return {
            **({**worst.key, **counts} if worst and counts else {}),
            **({"gap-begin": gap.begin, "gap-end": gap.end} if gap else {}),
        }

    def checks(self, limits: DetectionLimits) -> tuple[Check, ...]:
        """Totals, what was counted, and a line of measures for each class; a measure without a value keeps no limit."""
        total = self.counts.total()
        counts = {
            "true-positives": total.hits,
            "false-positives": total.false,
            "false-negatives": total.missed,
            "mean-iou": total.mean_overlap,
            "frames": self.frames,
        }
        left_out = {"without-truth": self.without_truth, "late": self.late, "repeated": self.repeated}
        return (
            *(_check(name, getattr(total, name), limits.of(name)) for name in MEASURES),
            *(Check(name, value) for name, value in counts.items()),
            _check("answered", self.answered, limits.frames, ("min-frames",)),
            _at_most("unanswered", self.unanswered.share, limits.unanswered),
            _at_most("gap", self.gap.end - self.gap.begin if self.gap else None, limits.gap, "s"),
            *(Check(name, value) for name, value in left_out.items()),
            *self._classes(limits),
        )

    def _classes(self, limits: DetectionLimits) -> Iterator[Check]:
        for label, counts in self.counts:
            for name in MEASURES:
                limit = limits.of(name) if limits.each_class else None
                yield _check(f"{name}-{label or 'unnamed'}", getattr(counts, name), limit, (f"min-{name}",))


def _check(name: str, value: float | None, least: float | None, parameters: tuple[str, ...] = ()) -> Check:
    if least is None:
        return Check(name, value)
    return Check(name, value, {"min": least}, "", value is not None and value >= least, parameters=parameters)


def _at_most(name: str, value: float | None, most: float | None, unit: str = "") -> Check:
    """A share of no frames keeps its limit, as no answer was expected."""
    if most is None:
        return Check(name, value, {}, unit)
    return Check(name, value, {"max": most}, unit, value is None or value <= most)
