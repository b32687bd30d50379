"""One image of the virtual camera under each condition: python benchmarks/pictures/contact_sheet.py FILE.png"""

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from dodo_dsl import package_data
from services.scene.camera import CameraMotion, CameraPose, Pinhole
from services.scene.lens import Distortion, Lens
from services.scene.raster import Image
from services.scene.render import Renderer
from services.scene.scene import SceneOptions, load_scene
from services.scene.shading import Light
from services.scene.truth import SceneTruth, classes_of
from services.virtual_camera.optics import Optics, Sensor

MAP = package_data.registry() / "maps" / "left-curve"
SIZE, FOVY, COLUMNS = (288, 216), math.radians(48.8), 4
LABEL = 24
PLACE = CameraPose.at(0.0, 0.2, 0.095, yaw=math.pi / 2)
MOTION = CameraMotion(PLACE, np.array([0.0, 0.6, 0.0]), np.array([0.0, 0.0, 0.5]))
SHEET: dict[str, tuple[SceneOptions, dict[str, object]]] = {
    "normal": (SceneOptions(), {}),
    "clutter=60": (SceneOptions(clutter=60, seed=1), {}),
    "exposure=3": (SceneOptions(), {"sensor": Sensor(exposure=3.0)}),
    "exposure=0.15": (SceneOptions(), {"sensor": Sensor(exposure=0.15)}),
    "noise=0.06": (SceneOptions(), {"sensor": Sensor(noise=0.06)}),
    "shutter=40ms": (SceneOptions(), {"shutter": 0.04}),
    "k1=-0.4 k2=0.1, lines": (
        SceneOptions(lines=("left", "right")),
        {"lens": Lens(Pinhole(*SIZE, FOVY), Distortion(-0.4, 0.1))},
    ),
    "low light, boxes": (SceneOptions(light=Light.of_flags(-60, 20, 0.3)), {}),
}


def draw_boxes(picture: Image, renderer: Renderer) -> None:
    truth = SceneTruth(renderer, classes_of([], renderer.bodies.names), 0.25, 4.0)
    for box in truth.boxes(PLACE):
        corner, end = (box.left, box.top), (box.left + box.width, box.top + box.height)
        cv2.rectangle(picture, [round(v) - 1 for v in corner], [round(v) for v in end], (40, 40, 255, 255))


def tiles() -> Iterator[Image]:
    for name, (options, parts) in SHEET.items():
        optics = Optics(Pinhole(*SIZE, FOVY), **parts)  # type: ignore[arg-type]
        renderer = Renderer(load_scene(MAP, options), optics.wide.width, optics.wide.height, optics.wide.fovy)
        picture = np.empty((SIZE[1], SIZE[0], 4), np.uint8)
        optics.expose(renderer, MOTION, CameraPose.at(0, 0, 0), 1_000_000, picture)
        if "boxes" in name:
            draw_boxes(picture, renderer)
        picture[:LABEL] = 255
        cv2.putText(picture, name, (8, LABEL - 7), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0, 255), 1, cv2.LINE_AA)
        yield picture


def sheet() -> Image:
    """All tiles, ``COLUMNS`` in a row."""
    drawn = list(tiles())
    rows = [np.hstack(drawn[i : i + COLUMNS]) for i in range(0, len(drawn), COLUMNS)]
    return np.asarray(cv2.cvtColor(np.vstack(rows), cv2.COLOR_BGRA2BGR), np.uint8)


if __name__ == "__main__":
    target = Path(sys.argv[1])
    cv2.imwrite(str(target), sheet(), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"{target}: {target.stat().st_size} bytes")
