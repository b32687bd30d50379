"""Lines of the map's obstacles as tape on the ground."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.inputs import obstacles
from dodo_dsl.opendlv.inputs.json_node import MapError
from dodo_dsl.opendlv.inputs.map_file import find_map
from dodo_dsl.opendlv.inputs.obstacles import Line
from services.scene.draw.faces import Face
from services.scene.draw.raster import Colour

TAPE: Colour = (235.0, 235.0, 235.0, 255.0)
THICKNESS = 0.0002
"""How high above z = 0 tape lies, in m: enough to be above the floor, and less than a model notices."""


def pick(path: Path, names: Sequence[str]) -> list[Line]:
    """The lines of a map's obstacles with these names; MapError when one is not there."""
    known = obstacles.read(find_map(path)) if names else {}
    for name in names:
        if name not in known:
            have = ", ".join(sorted(known)) or "none"
            raise MapError(find_map(path), f"there is no obstacle '{name}' with lines; the map has {have}")
    return [line for name, lines in known.items() if name in names for line in lines]


def line_faces(lines: Sequence[Line], width: float) -> Iterator[Face]:
    """A flat strip of ``width`` m for each line that has a length."""
    for (x1, y1), (x2, y2) in lines:
        start, end = np.array([x1, y1, THICKNESS]), np.array([x2, y2, THICKNESS])
        length = float(np.linalg.norm(end - start))
        if length > 0.0:
            along = (end - start) / length
            side = np.array([-along[1], along[0], 0.0]) * width / 2
            points = np.array([start - side, end - side, end + side, start + side])
            yield Face(points, np.array([0.0, 0.0, 1.0]), THICKNESS, TAPE)
