"""Boxes in a picture, and how well two of them agree."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Scores = NDArray[np.float64]


class Box(NamedTuple):
    """A box with its upper left corner; fractions of the picture, whose origin is at the upper left."""

    x: float
    y: float
    width: float
    height: float


class LabelledBox(NamedTuple):
    """A box with its class; the empty string is no class."""

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
        union = _areas(a) + _areas(b) - shared
        scores: Scores = np.where(_real(a) & _real(b) & (shared > 0.0), shared / union, 0.0)
    return np.nan_to_num(scores, nan=0.0, posinf=0.0)


def _corners(boxes: Sequence[Box]) -> Scores:
    """Left, top, right and bottom of each."""
    table = np.array(boxes, np.float64).reshape(-1, 4)
    with np.errstate(over="ignore", invalid="ignore"):
        table[:, 2:] += table[:, :2]
    return table


def _areas(corners: Scores) -> Scores:
    areas: Scores = np.prod(corners[..., 2:] - corners[..., :2], axis=-1)
    return areas


def _real(corners: Scores) -> NDArray[np.bool_]:
    facts = np.concatenate([np.isfinite(corners), corners[..., 2:] > corners[..., :2]], axis=-1)
    real: NDArray[np.bool_] = np.logical_and.reduce(facts, axis=-1)
    return real
