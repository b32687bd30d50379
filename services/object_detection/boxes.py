"""Boxes in a picture: true ones of a file, found ones of a frame's messages, and which of them pair up.

They pair up by how well they agree: intersection over union (thesis, figure 4.11).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.assets import truth_file
from dodo_dsl.opendlv.assets.truth_file import Frames, plain

Scores = NDArray[np.float64]


class Box(NamedTuple):
    """A box with its upper left corner; fractions of the picture, whose origin is at the upper left."""

    x: float
    y: float
    width: float
    height: float


class LabelledBox(NamedTuple):
    """A box with its class; the empty string is not a class."""

    label: str
    box: Box


def overlaps(found: Sequence[Box], true: Sequence[Box]) -> Scores:
    """Intersection over union (thesis, figure 4.11) of each found box with each true one: (found, true).

    A box without an area, or that is not finite, agrees with none.
    """
    a, b = _corners(found)[:, None], _corners(true)[None, :]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        sides = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
        shared = np.prod(np.maximum(sides, 0.0), axis=-1)
        areas = [np.prod(each[..., 2:] - each[..., :2], axis=-1) for each in (a, b)]
        union = areas[0] + areas[1] - shared
        scores: Scores = np.where(_real(a) & _real(b) & (shared > 0.0), shared / union, 0.0)
    return np.nan_to_num(scores, nan=0.0, posinf=0.0)


def _corners(boxes: Sequence[Box]) -> Scores:
    table = np.array(boxes, np.float64).reshape(-1, 4)
    with np.errstate(over="ignore", invalid="ignore"):
        table[:, 2:] += table[:, :2]
    return table


def _real(corners: Scores) -> NDArray[np.bool_]:
    facts = np.concatenate([np.isfinite(corners), corners[..., 2:] > corners[..., :2]], axis=-1)
    real: NDArray[np.bool_] = np.logical_and.reduce(facts, axis=-1)
    return real


Pair = tuple[int, int]


def best_pairs(scores: Scores, threshold: float) -> list[Pair]:
    """Pairs (row, column) of scores above a threshold: as many as can be, and of those the largest sum.

    Each row and column is in one pair at most. `scores` are from 0 to 1; a score equal to the threshold is not a pair.
    """
    allowed = scores > threshold
    rows, columns = np.flatnonzero(allowed.any(1)), np.flatnonzero(allowed.any(0))
    if not len(rows):
        return []
    part, may = scores[np.ix_(rows, columns)], allowed[np.ix_(rows, columns)]
    more_than_all = min(part.shape) + 1.0
    gains = np.where(may, part + more_than_all, 0.0)
    turned = len(rows) > len(columns)
    chosen = enumerate(_assigned(-gains.T if turned else -gains).tolist())
    pairs = [(column, row) if turned else (row, column) for column, row in chosen if row >= 0]
    return sorted((int(rows[a]), int(columns[b])) for a, b in pairs if may[a, b])


def _assigned(costs: Scores) -> NDArray[np.int64]:
    """The row of each column, -1 for none, so that the sum of costs is smallest; there are no more rows than columns.

    Rows join one by one, each along the shortest path of changes that frees a column (Kuhn 1955, in the form of
    Jonker and Volgenant 1987), with prices of rows and columns. The last column stands for the newcomer.
    """
    rows, columns = costs.shape
    row_price, column_price = np.zeros(rows), np.zeros(columns + 1)
    row_of = np.full(columns + 1, -1)
    for newcomer in range(rows):
        row_of[-1], column = newcomer, columns
        lengths, came_from = np.full(columns + 1, np.inf), np.full(columns + 1, -1)
        settled = np.zeros(columns + 1, np.bool_)
        while row_of[column] >= 0:
            settled[column], row = True, row_of[column]
            through = np.append(costs[row] - row_price[row] - column_price[:-1], np.inf)
            shorter = ~settled & (through < lengths)
            lengths[shorter], came_from[shorter] = through[shorter], column
            nearest = int(np.argmin(np.where(settled, np.inf, lengths)))
            row_price[row_of[settled]] += lengths[nearest]
            column_price[settled] -= lengths[nearest]
            lengths[~settled] -= lengths[nearest]
            column = nearest
        while column != columns:
            row_of[column], column = row_of[came_from[column]], came_from[column]
    return row_of[:-1]


class FrameKey(NamedTuple):
    """Which frame a message is about: its sample time (microseconds), and the sampleId that came with it."""

    time: int
    number: int


class TypeNumber(NamedTuple):
    """The class of a detection by its DetectionType alone."""

    number: int


Value = Box | str | TypeNumber
"""The content of a message: DetectionBoundingBox, DetectionProperty or DetectionType."""


MOST_LABEL = 60
"""Characters of a class: an application may send any."""


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
            self.labels.setdefault(number, plain(value)[:MOST_LABEL])

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


@dataclass(frozen=True)
class Truth:
    """The true boxes of each picture; ``frames`` says how a frame finds its picture."""

    frames: Frames
    pictures: Mapping[int, tuple[LabelledBox, ...]]

    def picture_of(self, key: FrameKey) -> int:
        return {"one": 0, "sample-time": key.time, "number": key.number}[self.frames]

    def of(self, key: FrameKey) -> tuple[LabelledBox, ...] | None:
        """The true boxes of a frame; None if the file does not have it."""
        return self.pictures.get(self.picture_of(key))

    def labels(self) -> list[str]:
        return sorted({each.label for boxes in self.pictures.values() for each in boxes})


def load_truth(path: Path, frames: Frames) -> Truth:
    found = truth_file.read(path, frames)
    pictures = {key: tuple(LabelledBox(label, Box(*area)) for label, area in boxes) for key, boxes in found.items()}
    return Truth(frames, pictures)
