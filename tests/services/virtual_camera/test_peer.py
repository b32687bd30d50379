"""The same pictures by OpenGL, where there is moderngl with EGL; llvmpipe is enough."""

import json
import math
import shutil

import numpy as np
import pytest

from dodo_dsl import package_data
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.scene.truth import SceneTruth, TruthLimits, classes_of

MAPS = package_data.registry() / "maps"
FOVY = math.radians(48.8)


@pytest.fixture(scope="module")
def peer():
    pytest.importorskip("moderngl", reason="the package moderngl is not here")
    from benchmarks.pictures import gl_peer

    try:
        gl_peer.GlPeer(MAPS / "straight", 64, 48, FOVY)
    except Exception as error:  # noqa: BLE001 - moderngl raises just that without EGL
        pytest.skip(f"OpenGL is not here: {error}")
    return gl_peer


@pytest.mark.parametrize(
    ("name", "pose"),
    [
        ("straight", CameraPose.at(0, 0, 0.095, yaw=math.pi / 2)),
        ("left-curve", CameraPose.at(0.1, 0.6, 0.15, roll=0.1, pitch=0.2, yaw=1.9)),
        ("kiwi-track", CameraPose.at(0, 0, 0.095, yaw=math.pi / 2)),
    ],
)
def test_shipped_maps_look_alike(peer, name, pose):
    ours, theirs = Renderer(load_scene(MAPS / name), 640, 480, FOVY), peer.GlPeer(MAPS / name, 640, 480, FOVY)
    view = ours.camera.view(pose)
    assert peer.ssim(ours.render(pose), theirs.render(view.position, view.axes)) > 0.95


def test_models_and_blocks_that_intersect_look_alike(peer, write_map):
    models = [
        {"name": n, "file": "cube.obj", "color": c, "instances": [i]}
        for n, c, i in (("a", [1, 0, 0], [3, 0, 0, 0.3]), ("b", [0, 1, 0], [3.4, 0.5, 0.3, 1]))
    ]
    blocks = [
        {"name": "f", "dimension": [30, 30, 0.2], "color": [0.5, 0.5, 0.5], "instances": [[0, 0, -0.1, 0]]},
        {"name": "w", "dimension": [1, 1, 1], "color": [1, 1, 0], "instances": [[2.8, -0.4, 0.7, 0.2]]},
    ]
    folder = write_map({"model": models, "block": blocks})
    ours, theirs = Renderer(load_scene(folder), 320, 240, FOVY), peer.GlPeer(folder, 320, 240, FOVY)
    for angle in (0.0, 2.0, 4.0):
        pose = CameraPose.at(3 - 3 * math.cos(angle), -3 * math.sin(angle), 1.2, pitch=0.25, yaw=angle)
        view = ours.camera.view(pose)
        one, other = ours.render(pose), theirs.render(view.position, view.axes)
        assert peer.ssim(one, other) > 0.95
        assert (np.abs(one.astype(int) - other).max(axis=-1) > 40).mean() < 0.01


def test_boxes_hold_the_pixels_that_opengl_draws(peer, tmp_path):
    """One cone at a time, in a colour that nothing else has: its pixels end where its box does."""
    shutil.copy(MAPS / "straight" / "cone.obj", tmp_path / "cone.obj")
    for x, y, angle in ((0.4, 0.1, 0.0), (0.8, -0.2, 1.0), (0.25, 0.1, 0.5), (1.5, 0.0, 0.0)):
        model = {"name": "cone", "file": "cone.obj", "color": [1, 0, 0], "instances": [[x, y, 0, angle]]}
        (tmp_path / "map.json").write_text(json.dumps({"model": [model]}))
        ours, theirs = Renderer(load_scene(tmp_path), 640, 480, FOVY), peer.GlPeer(tmp_path, 640, 480, FOVY)
        pose = CameraPose.at(0, 0, 0.095)
        view = ours.camera.view(pose)
        picture = theirs.render(view.position, view.axes)
        rows, columns = np.nonzero((picture[..., 2] > 120) & (picture[..., 0] < 60))
        (box,) = SceneTruth(ours, classes_of([], ours.bodies.names), TruthLimits(0.0, 0.0)).boxes(pose)
        seen = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        told = (box.left, box.top, box.left + box.width, box.top + box.height)
        assert told == pytest.approx(seen, abs=1.5)
