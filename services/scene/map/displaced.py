"""Models beside the places that the map gives them, as people put them down; the same ones for the same seed."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from services.scene.draw.copies import Copies

_STREAM = 5711
"""Other random numbers than those of the clutter and the noise of the same seed."""


def displaced(models: tuple[Copies, ...], reach: float, seed: int) -> tuple[Copies, ...]:
    """Each copy moved along the ground to a point of the disc of ``reach`` (m) around its place, all alike likely.

    A larger reach moves it further in the same direction, so that what depends on the reach does so without jumps.
    """
    return tuple(_moved(models, reach, seed)) if reach else models


def _moved(models: tuple[Copies, ...], reach: float, seed: int) -> Iterator[Copies]:
    random = np.random.RandomState([_STREAM, seed])
    for copies in models:
        share = np.sqrt(random.uniform(0, 1, len(copies.positions)))
        direction = random.uniform(0, 2 * np.pi, len(copies.positions))
        ahead, left = reach * share * np.cos(direction), reach * share * np.sin(direction)
        yield replace(copies, positions=copies.positions + np.column_stack([ahead, left, np.zeros_like(ahead)]))
