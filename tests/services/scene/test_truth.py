import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl import package_data
from services.scene.camera import CameraPose, Pinhole, still
from services.scene.lens import Distortion, Lens
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.scene.truth import SceneTruth, TrueBox, classes_of
from services.virtual_camera.optics import Optics

STRAIGHT = package_data.registry() / "maps" / "straight"
FOVY = math.radians(48.8)
FOCAL = 240 / math.tan(FOVY / 2)
ALL = (0.0, 0.0)


def boxes(folder, pose, limits=ALL, classes=(), options=None, size=(640, 480)):
    renderer = Renderer(load_scene(folder, options), *size, FOVY)
    return SceneTruth(renderer, classes_of(classes, renderer.bodies.names), *limits).boxes(pose)


def edges(box: TrueBox) -> tuple[float, ...]:
    return box.left, box.left + box.width, box.top, box.top + box.height


@pytest.fixture(scope="module")
def straight():
    return Renderer(load_scene(STRAIGHT), 640, 480, FOVY)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(-0.2, 0.2), st.floats(-0.3, 3), st.floats(0.05, 0.3), st.floats(-0.2, 0.2), st.floats(1.0, 2.2))
@pytest.mark.thorough
def test_a_box_holds_the_projection_of_all_corners(straight, x, y, z, pitch, yaw):
    """Any camera without roll: each box is that of the model's corners by the pinhole equation, cut at the edges."""
    for box in SceneTruth(straight, classes_of([], straight.bodies.names), *ALL).boxes(
        CameraPose.at(x, y, z, pitch=pitch, yaw=yaw)
    ):
        dx, dy, dz = (straight.bodies.outline(box.number)[0] - [x, y, z]).T
        ahead, left = math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx
        forward, up = math.cos(pitch) * ahead - math.sin(pitch) * dz, math.sin(pitch) * ahead + math.cos(pitch) * dz
        if forward.min() < 0.011:
            continue
        u, v = 320 - FOCAL * left / forward, 240 - FOCAL * up / forward
        cut = [np.clip(part, 0, most) for part, most in ((u, 640), (v, 480))]
        assert edges(box) == pytest.approx([f(part) for part in cut for f in (np.min, np.max)], abs=1e-6)


def test_what_hides_a_model_takes_from_its_visible_share(cube_at):
    """Two cubes one behind the other; the nearer is smaller in height but as wide as the other's left half."""
    apart = boxes(cube_at([4, 0, 0, 0], [9, 3, 0, 0]), CameraPose.at(0, 0, 0.5))
    assert [box.visible for box in apart] == [1.0, 1.0]
    near = [2.0, 0.5, 0, 0]
    found = boxes(cube_at([4, 0, 0, 0], near), CameraPose.at(0, 0, 0.5))
    far = next(box for box in found if box.number == 0)
    # its front spans +-0.5 m at 3.5 m; the nearer front, at 1.5 m, reaches right to y = 0, and hides half of it
    assert far.visible == pytest.approx(0.5, abs=0.03)
    whole = (320 - FOCAL * 0.5 / 3.5, 320 + FOCAL * 0.5 / 3.5)
    assert edges(far)[:2] == pytest.approx(whole, abs=0.01)
    assert [box.number for box in boxes(cube_at([4, 0, 0, 0], near), CameraPose.at(0, 0, 0.5), (0.6, 0))] == [1]


def test_a_cut_model_has_a_cut_box_and_the_share_that_is_inside(cube_at):
    left = 2 * 320 / FOCAL  # where the picture ends at 2 m
    (box,) = boxes(cube_at([2.5, left, 0, 0]), CameraPose.at(0, 0, 0.5))
    assert box.left == 0
    assert box.width == pytest.approx(320 - FOCAL * (left - 0.5) / 3, abs=0.01)  # its far right edge, at 3 m
    assert box.visible < 0.7
    assert boxes(cube_at([2.5, left, 0, 0]), CameraPose.at(0, 0, 0.5), (0.8, 0)) == []


def test_classes_are_those_written_or_the_models_own_names():
    names = ["cone_yellow", "cone_yellow", "cone_blue", ""]
    assert classes_of([], names) == {"cone_yellow": "cone_yellow", "cone_blue": "cone_blue"}
    assert classes_of(["cone_blue=blue", "cone_yellow"], names) == {"cone_blue": "blue", "cone_yellow": "cone_yellow"}
    with pytest.raises(ValueError, match="no model 'cone_red' in the map, which has cone_yellow, cone_blue"):
        classes_of(["cone_red=red"], names)


@pytest.mark.slow
@pytest.mark.parametrize("k1", [-0.25, 0.4])
def test_through_a_lens_boxes_are_where_the_lens_shows_the_models(cube_at, k1):
    scene = load_scene(cube_at([3.05, 1.0, 0, 0], [3.05, -0.4, 0.5, 0], half=0.05, height=0.1))
    camera = Pinhole(640, 480, FOVY)
    optics = Optics(camera, Lens(camera, Distortion(k1, 0.05)))
    renderer = Renderer(scene, optics.wide.width, optics.wide.height, optics.wide.fovy)
    out, pose = np.empty((480, 640, 4), np.uint8), CameraPose.at(0, 0, 0.3)
    optics.expose(renderer, still(pose), CameraPose.at(0, 0, 0), 0, out)
    red = (out[..., 2] > 100) & (out[..., 0] < 60)
    found = SceneTruth(renderer, {"cube": "cube"}, *ALL, optics.lens).boxes(pose)
    assert len(found) == 2
    for box in found:
        side = slice(0, 320) if box.left < 320 else slice(320, 640)
        rows, columns = np.nonzero(red[:, side])
        seen = (columns.min() + side.start, columns.max() + 1 + side.start, rows.min(), rows.max() + 1)
        assert edges(box) == pytest.approx(seen, abs=1.5)
