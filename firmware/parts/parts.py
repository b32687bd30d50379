"""Parts to be printed, as watertight meshes in mm: cones as the maps have them, the camera's holder, and an index cam.

Solids are revolved or extruded, so that they need no engine for booleans.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import trimesh

from firmware.parts.measures import INDEX_WIDTH, LENS, PLATE

MAP = Path(__file__).parents[2] / "tests_registry" / "maps" / "rig-straight"
BED = 200.0
"""Side of the smallest printer's bed that is thought of."""
SIDES = 64
HUB_FRONT, HUB_BACK, HUB_HALF = 22.0, -112.0, 35.0
"""The hub's plate: its axis of yaw is at 0."""
LENS_DROP, LENS_MARGIN = 20.0, 16.0
"""From the hub's plate down to the lens, and from there to the lower edge of the camera's plate."""
CAMERA_HALF, TAB, TAB_AT, FIT = 30.0, 10.0, 20.0, 0.15
"""Half the camera plate's width, the width of its tabs and their middles, and the play of a slot to each side."""
CAMERA_HOLES, CAMERA_HOLE, WINDOW = (21.0, 12.5), 2.2, 10.0
"""Of a Raspberry Pi Camera Module 2: its lens is between two of its holes."""
PI_HOLES, PI_HOLE, PI_EDGE, PI_BACK = (58.0, 49.0), 2.7, 3.5, -109.0
FLANGE, FLANGE_HOLE, SHAFT = 16.0, 3.2, 6.0
"""The coupling's circle of four M3 screws, and a hole with play for a shaft of 5 mm."""
CAM, CAM_LOW, CAM_HEIGHT, CAM_BORE = 30.0, 25.0, 6.0, 5.1

Part = Callable[[], Any]


def lowest() -> float:
    """Height of the hub's lowest edge above the table."""
    return LENS - LENS_MARGIN


def cone_profile(file: str) -> list[tuple[float, float]]:
    """Radius and height of the corners of a cone of the maps, from the table upwards."""
    rows = [line.split() for line in (MAP / file).read_text().splitlines() if line.startswith("v ")]
    corners = [tuple(1000 * float(word) for word in row[1:]) for row in rows]
    return [(x, z) for x, y, z in corners if y == 0 and x > 0]


def cone(file: str = "cone.obj") -> Any:
    profile = cone_profile(file)
    return trimesh.creation.revolve([(0.0, 0.0), *profile, (0.0, profile[-1][1])], sections=SIDES)


def finish_cone() -> Any:
    return cone("finish-cone.obj")


def hub_outline() -> Any:
    """Below the yaw's motor: it carries the Raspberry Pi, and the camera's plate in two slots."""
    holes = [_circle(0, 0, SHAFT)]
    holes += [_circle(FLANGE / 2 * c, FLANGE / 2 * s, FLANGE_HOLE) for c, s in _corners(math.sqrt(0.5), math.sqrt(0.5))]
    middle = PI_BACK + PI_EDGE + PI_HOLES[0] / 2
    holes += [_circle(middle + x, y, PI_HOLE) for x, y in _corners(PI_HOLES[0] / 2, PI_HOLES[1] / 2)]
    back, front, half = -1 - PLATE - FIT, -1 + FIT, TAB / 2 + FIT
    holes += [shapely.box(back, y - half, front, y + half) for y in (TAB_AT, -TAB_AT)]
    return _without(shapely.box(HUB_BACK, -HUB_HALF, HUB_FRONT, HUB_HALF), holes)


def hub_plate() -> Any:
    return _extruded(hub_outline(), PLATE)


def camera_outline() -> Any:
    """Lies on its front, its lower edge at y = 0: the camera's board is screwed to it from behind."""
    height = LENS_MARGIN + LENS_DROP
    outline = shapely.box(-CAMERA_HALF, 0, CAMERA_HALF, height)
    tabs = [shapely.box(x - TAB / 2, height - 1, x + TAB / 2, height + PLATE) for x in (TAB_AT, -TAB_AT)]
    width, up = CAMERA_HOLES
    holes = [_circle(x, LENS_MARGIN + y, CAMERA_HOLE) for x in (-width / 2, width / 2) for y in (0, up)]
    side = WINDOW / 2
    holes.append(shapely.box(-side, LENS_MARGIN - side, side, LENS_MARGIN + side))
    return _without(shapely.union_all([outline, *tabs]), holes)


def camera_plate() -> Any:
    return _extruded(camera_outline(), PLATE)


def index_cam() -> Any:
    """On the yaw's shaft of a rig of the kind circle: high over the arc of the index, which ends at the back."""
    ends = math.radians(180 - INDEX_WIDTH), math.pi
    high = [(CAM * math.cos(a), CAM * math.sin(a)) for a in np.linspace(*ends, 9)]
    low = [(CAM_LOW * math.cos(a), CAM_LOW * math.sin(a)) for a in np.linspace(ends[1], ends[0] + math.tau, SIDES)]
    return _extruded(_without(shapely.Polygon(high + low), [_circle(0, 0, CAM_BORE)]), CAM_HEIGHT)


PARTS: dict[str, Part] = {
    "cone": cone,
    "finish-cone": finish_cone,
    "hub-plate": hub_plate,
    "camera-plate": camera_plate,
    "index-cam": index_cam,
}


def write(folder: Path) -> list[Path]:
    """Writes each part as binary STL; the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}.stl" for name in PARTS]
    for file, make in zip(files, PARTS.values(), strict=True):
        file.write_bytes(make().export(file_type="stl"))
    return files


def _corners(x: float, y: float) -> list[tuple[float, float]]:
    return [(x, y), (x, -y), (-x, y), (-x, -y)]


def _circle(x: float, y: float, diameter: float) -> Any:
    return shapely.Point(x, y).buffer(diameter / 2, quad_segs=SIDES // 8)


def _without(outline: Any, holes: list[Any]) -> Any:
    """Whose corners are always in one order."""
    return outline.difference(shapely.union_all(holes)).normalize()


def _extruded(outline: Any, height: float) -> Any:
    """A plate on z = 0."""
    triangles = shapely.constrained_delaunay_triangles(outline).geoms
    corners = np.array([triangle.exterior.coords[:3] for triangle in triangles])
    vertices, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return trimesh.creation.extrude_triangulation(vertices, faces.reshape(-1, 3), height)
