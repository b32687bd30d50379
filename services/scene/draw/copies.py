"""Copies of one model."""

from dataclasses import dataclass

from services.scene.camera import Array
from services.scene.draw.shape import Shape


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of one shape: ``positions`` (n, 3) in m, ``turns`` (n,) in rad counter-clockwise about z.

    ``name`` is the model's in the map; scenery has none, and no boxes.
    """

    shape: Shape
    colour: Array
    """Blue, green, red from 0 to 255."""
    positions: Array
    turns: Array
    name: str = ""
