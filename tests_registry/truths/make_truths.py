"""Makes the truths beside this file: python tests_registry/truths/make_truths.py [FOLDER].

``static-rig.json`` is COCO JSON, in pixels, for the emulated static rig: the cones of the map ``static-rig`` as a
camera of 640 x 480 pixels sees them from 9.5 cm above x = 0, y = 0, along +x and level, with a vertical field of view
of 48.8 degrees. A box holds the whole cone, also what another cone hides of it, and ends where the frame does. A
real rig has another truth: one that was made of its own frame.
"""

import importlib.util
import json
import math
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT, FOVY, ABOVE = 640, 480, math.radians(48.8), 0.095
FOCAL = HEIGHT / 2 / math.tan(FOVY / 2)
CLASSES = {"yellow": 1, "blue": 2}
Box = tuple[float, float, float, float]


def _maps() -> Any:
    spec = importlib.util.spec_from_file_location("make_maps", HERE.parent / "maps" / "make_maps.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def corners(obj: str) -> list[tuple[float, float, float]]:
    """The corners of a model in the OBJ format, in m."""
    lines = [line.split() for line in obj.splitlines() if line.startswith("v ")]
    return [(float(x), float(y), float(z)) for _, x, y, z in lines]


def box(x: float, y: float, cone: list[tuple[float, float, float]]) -> Box:
    """x, y, width and height in pixels of a cone that stands ``x`` m ahead and ``y`` m to the left."""
    columns = [WIDTH / 2 - FOCAL * (y + v) / (x + u) for u, v, _ in cone]
    rows = [HEIGHT / 2 + FOCAL * (ABOVE - w) / (x + u) for u, _, w in cone]
    left, right = max(0.0, min(columns)), min(float(WIDTH), max(columns))
    top, bottom = max(0.0, min(rows)), min(float(HEIGHT), max(rows))
    return round(left, 1), round(top, 1), round(right - left, 1), round(bottom - top, 1)


def truth() -> dict[str, Any]:
    """The document; annotations are numbered from 1, the yellow cones first."""
    maps = _maps()
    cone = corners(maps.cone_obj(1.0))
    boxes = [(CLASSES[name], box(x, y, cone)) for name, places in maps.BOARD.items() for x, y in places]
    return {
        "images": [{"id": 1, "file_name": "static-rig.png", "width": WIDTH, "height": HEIGHT}],
        "categories": [{"id": number, "name": name} for name, number in CLASSES.items()],
        "annotations": [
            {
                "id": number,
                "image_id": 1,
                "category_id": category,
                "bbox": list(bbox),
                "area": round(bbox[2] * bbox[3], 1),
                "iscrowd": 0,
            }
            for number, (category, bbox) in enumerate(boxes, start=1)
        ],
    }


def make(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "static-rig.json").write_text(json.dumps(truth(), indent=1) + "\n")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
