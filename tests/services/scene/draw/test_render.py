import hashlib
import json
import math

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl import package_data
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene

FOVY = math.radians(48.8)
FOCAL = 240 / math.tan(FOVY / 2)


def draw(folder, *pose, size=(640, 480), **angles):
    return Renderer(load_scene(folder), *size, FOVY).render(CameraPose.at(*pose, **angles))


def red_box(image):
    """First and last-but-one columns and rows of what is red."""
    red = (image[..., 2] > 100) & (image[..., 0] < 50)
    rows, columns = np.flatnonzero(red.any(axis=1)), np.flatnonzero(red.any(axis=0))
    return (columns[0], columns[-1] + 1, rows[0], rows[-1] + 1) if len(rows) else None


def pinhole(points, x, y, z, yaw):
    """u = cx - f left / forward, v = cy - f up / forward, for a level camera; pixels from the picture's corner."""
    dx, dy, dz = (np.array(points) - [x, y, z]).T
    forward, left = math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx
    return 320 - FOCAL * left / forward, 240 - FOCAL * dz / forward


@pytest.mark.parametrize("distance", [0.4, 1.0, 2.5, 6.0])
@pytest.mark.parametrize("aside", [0.0, 0.111, -0.15])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_a_box_is_where_the_pinhole_equation_says(cube_at, distance, aside, yaw):
    x = 3 + distance * math.cos(yaw) - aside * math.sin(yaw)
    y = -1 + distance * math.sin(yaw) + aside * math.cos(yaw)
    image = draw(cube_at([x, y, 0.0, 0.3], half=0.05, height=0.1), 3, -1, 0.07, yaw=yaw)
    turn = math.pi - 0.3
    corners = [
        (x + a * math.cos(turn) - b * math.sin(turn), y + a * math.sin(turn) + b * math.cos(turn), c)
        for a in (-0.05, 0.05)
        for b in (-0.05, 0.05)
        for c in (0.0, 0.1)
    ]
    u, v = pinhole(corners, 3, -1, 0.07, yaw)
    assert red_box(image) == pytest.approx((u.min(), u.max(), v.min(), v.max()), abs=1.0)


def test_silhouettes_cover_what_all_the_faces_would():
    """Far cones in a small picture, drawn as silhouettes, and in one of four times the size, face by face."""
    scene = load_scene(package_data.registry() / "maps" / "straight")
    small, large = (Renderer(scene, 480 * k, 360 * k, 0.5) for k in (1, 4))
    covered = []
    for x in np.linspace(-2.5, -2.1, 9):
        pose = CameraPose.at(float(x), 1.4, 0.4, pitch=0.25)
        covered.append([(r.render(pose)[..., 0] < 40).sum() for r in (small, large)])
    few, many = np.sum(covered, axis=0)
    assert few > 500
    assert few == pytest.approx(many / 16, rel=0.08)


def test_a_wall_that_passes_the_camera_fills_its_side_only(cube_at):
    """A long box beside the camera reaches from before it to behind it."""
    image = draw(cube_at([0, 30.2, 0, 0], half=30, height=5), 0, 0, 1.0)
    red = (image[..., 2] > 100) & (image[..., 0] < 50)
    assert red[240, :300].all()
    assert not red[:, 321:].any()
    # its lower edge runs to the vanishing point: v - 240 = f h / x and 320 - u = f 0.2 / x
    for column in (20, 100, 200, 280):
        lowest = np.flatnonzero(red[:, column]).max() + 1
        assert lowest == pytest.approx(min(480, 240 + (320 - column - 0.5) * 1.0 / 0.2), abs=2)


def test_a_block_hides_what_stands_behind_it_though_its_centre_is_farther(write_map):
    """Sorting by the distance of centres would draw the long wall first here."""
    wall = {"name": "wall", "dimension": [0.2, 40, 2], "color": [0, 0, 1], "instances": [[4, 15, 1, 0]]}
    model = {"name": "cube", "file": "cube.obj", "color": [1, 0, 0], "instances": [[6, 0, 0, 0]]}
    assert red_box(draw(write_map({"model": [model], "block": [wall]}), 0, 0, 0.5)) is None
    model["instances"] = [[3, 0, 0, 0]]
    assert red_box(draw(write_map({"model": [model], "block": [wall]}), 0, 0, 0.5)) is not None


def test_two_renders_are_equal_whatever_was_drawn_between(cube_at):
    folder = cube_at([4, 0, 0, 0.2], [9, 3, 0, 0], [0.6, 0, 0, 1])
    pose, other = CameraPose.at(0, 0.1, 0.3, 0.02, 0.1, 0.1), CameraPose.at(1, 5, 2, yaw=3)
    one, two = (Renderer(load_scene(folder), 320, 240, FOVY) for _ in range(2))
    first = one.render(pose)
    one.render(other)
    buffer = np.full_like(first, 99)
    assert two.render(pose, buffer) is buffer
    digests = {hashlib.sha256(image).hexdigest() for image in (first, one.render(pose), buffer)}
    assert len(digests) == 1


CORNERS = "v -1 -1 0\nv 1 -1 0\nv 0 1 1.5\nf 1 2 3\n"
coordinate = st.floats(-12, 12) | st.sampled_from([0.0, 1.0, 5.0, 1e6, -1e6, 1e-9])
angle = st.floats(-7, 7) | st.sampled_from([0.0, math.pi / 2, -math.pi / 2, math.pi])


def crowded_map(folder):
    """All kinds of things: blocks that intersect, textured and not, boxes, an open triangle, something huge."""
    (folder / "open.obj").write_text(CORNERS)
    (folder / "big.obj").write_text("\n".join(["v -50 0 0", "v 50 0 0", "v 50 9 40", "v -50 9 40", "f 1 2 3 4"]))
    cv2.imwrite(str(folder / "t.png"), np.random.RandomState(1).randint(0, 256, (37, 50, 3)).astype(np.uint8))
    places = [[x, y, 0, x * y] for x in range(-4, 5, 2) for y in range(-4, 5, 2)]
    blocks = [
        {
            "name": "f",
            "dimension": [10, 10, 0.2],
            "textureFile": "t.png",
            "textureSize": [0.7, 1],
            "instances": [[0, 0, -0.1, 0]],
        },
        {
            "name": "w",
            "dimension": [11, 0.5, 2],
            "textureFile": "t.png",
            "instances": [[5, 0, 0.8, 1.57], [0, 5, 0.8, 0]],
        },
        {"name": "b", "dimension": [1, 1, 1], "color": [0, 1, 0], "instances": [[1, 1, 0, 0.7], [1.5, 1, 0.2, 0]]},
    ]
    models = [
        {"name": "o", "file": "open.obj", "color": [1, 1, 0], "instances": places},
        {"name": "g", "file": "big.obj", "color": [0, 1, 1], "instances": [[3, 3, 0, 0]]},
    ]
    (folder / "map.json").write_text(json.dumps({"model": models, "block": blocks}))
    return folder


@pytest.fixture(scope="module")
def crowded(tmp_path_factory):
    return Renderer(load_scene(crowded_map(tmp_path_factory.mktemp("crowded"))), 96, 64, 1.0)


@pytest.mark.slow
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.tuples(coordinate, coordinate, coordinate), st.tuples(angle, angle, angle))
def test_any_pose_gives_a_whole_picture(crowded, place, angles):
    image = crowded.render(CameraPose.at(*place, *angles))
    assert (image[..., 3] == 255).all()
    assert np.array_equal(image, crowded.render(CameraPose.at(*place, *angles)))
