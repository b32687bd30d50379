"""Models at the frames of senders, against models that stand at the same places."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import SceneOptions, load_scene
from services.scene.truth import SceneTruth
from tests.services.map_folders import CUBE

WEDGE = "v 0.1 0.2 0\nv -0.1 0.2 0\nv 0 -0.3 0\nv 0 0.2 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
"""Pointed along -y, which is the front of a model at a frame."""
FLOOR = {"name": "floor", "dimension": [90, 90, 1], "color": [1, 1, 1], "instances": [[0, 0, -0.5, 0]]}
WALL = {"name": "wall", "dimension": [0.1, 0.5, 1], "color": [0, 0.5, 0], "instances": [[1.2, 0, 0.5, 0.3]]}
EYE = CameraPose.at(0.0, 0.0, 0.4, pitch=0.1)
SPOTS = [(0.8, 0.1, 0.0, 0.4), (2.0, -0.6, 0.1, 2.9), (2.2, 0.9, 0.0, -1.3)]

Write = Callable[..., Path]


def model(name: str = "car", **where: Any) -> dict[str, Any]:
    return {"name": name, "file": f"{name}.obj", "color": [0.9, 0.2, 0.1], **where}


def renderer(write_map: Write, *models: dict[str, Any], own: int | None = None) -> Renderer:
    cube = "\n".join(
        line.replace("1", "0.1").replace("2", "0.2") if line[0] == "v" else line for line in CUBE.split("\n")[1:-1]
    )
    folder = write_map({"model": list(models), "block": [FLOOR, WALL]}, {"car.obj": WEDGE, "cube.obj": cube})
    return Renderer(load_scene(folder, SceneOptions(own=own)), 320, 240, math.radians(60))


def drive(it: Renderer, stamp: int, x: float, y: float, z: float, yaw: float) -> None:
    it.place(stamp, CameraPose.at(x, y, z, yaw=yaw))


def standing(x: float, y: float, z: float, yaw: float) -> list[float]:
    """The place of an instance that OpenDLV's camera draws as a model at this frame."""
    return [x, y, z, math.pi / 2 - yaw]


def test_a_model_at_a_frame_looks_like_one_that_stands_there(write_map: Write) -> None:
    """Before and behind a wall and another model, and again after it has moved on."""
    cube = model("cube", instances=[[1.5, 0.1, 0, 0.2]])
    moving = renderer(write_map, cube, model(frames=[7]))
    empty = renderer(write_map, cube).render(EYE)
    np.testing.assert_array_equal(moving.render(EYE), empty)
    for spot in SPOTS:
        drive(moving, 7, *spot)
        still = renderer(write_map, cube, model(instances=[standing(*spot)]))
        np.testing.assert_allclose(still.bodies.outline(1)[0], moving.bodies.outline(1)[0], atol=1e-12)
        picture = still.render(EYE)
        assert (picture != empty).any()
        np.testing.assert_array_equal(moving.render(EYE), picture)


def test_true_boxes_move_along(write_map: Write) -> None:
    it = renderer(write_map, model("cube", instances=[[3, 0.8, 0, 0]]), model(frames=[7]))
    truth = SceneTruth(it, {"car": "car", "cube": "cube"}, 0.25, 4.0)
    assert [box.name for box in truth.boxes(EYE)] == ["cube"]
    for spot in SPOTS:
        drive(it, 7, *spot)
        still = renderer(write_map, model("cube", instances=[[3, 0.8, 0, 0]]), model(instances=[standing(*spot)]))
        assert truth.boxes(EYE) == SceneTruth(still, {"car": "car", "cube": "cube"}, 0.25, 4.0).boxes(EYE)
    drive(it, 7, -3.0, 0.0, 0.0, 0.0)
    assert [box.name for box in truth.boxes(EYE)] == ["cube"]
