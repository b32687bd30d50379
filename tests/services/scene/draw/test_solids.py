import math

import numpy as np
import pytest

from services.scene.bodies import MAX_FACES
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene


def crossing(folder_of, *places, block=()):
    """Cubes of 1 m, each of another colour."""
    colours = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    models = [
        {"name": f"cube{i}", "file": "cube.obj", "color": colours[i], "instances": [list(place)]}
        for i, place in enumerate(places)
    ]
    return load_scene(folder_of({"model": models, "block": list(block)}))


def nearest(spots, view, half=0.5, height=1.0):
    """Which upright cube, at (x, y, z, angle) each, the ray of each pixel meets first; -1 where none."""
    camera = view.camera
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    rays = np.stack([(u - camera.centre[0]) / camera.focal, (v - camera.centre[1]) / camera.focal, np.ones_like(u)], -1)
    rays = rays @ view.axes
    best, owner = np.full(u.shape, np.inf), np.full(u.shape, -1)
    for number, (x, y, z, angle) in enumerate(spots):
        c, s = math.cos(math.pi - angle), math.sin(math.pi - angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        start, way = (view.position - [x, y, z]) @ turn, rays @ turn
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = (np.stack([np.array([-half, -half, 0]) - start, np.array([half, half, height]) - start]))[
                :, None, None
            ]
            hits = ends / way
        enter, leave = hits.min(axis=0).max(axis=-1), hits.max(axis=0).min(axis=-1)
        met = (enter < leave) & (enter > 0) & (enter < best)
        best, owner = np.where(met, enter, best), np.where(met, number, owner)
    return owner


@pytest.mark.parametrize("seed", range(6))
def test_cubes_that_intersect_hide_one_another_as_rays_say(write_map, seed):
    random = np.random.RandomState(seed)
    spots = [(3 + random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), 0, random.uniform(0, 3)) for _ in range(3)]
    renderer = Renderer(crossing(write_map, *spots), 160, 120, 0.9)
    pose = CameraPose.at(0, random.uniform(-1, 1), random.uniform(0.3, 2.5), pitch=0.3)
    image, owner = renderer.render(pose), nearest(spots, renderer.camera.view(pose))
    labels, _ = renderer.labels(pose)
    assert np.isin(labels, [-1, 0, 1, 2]).all()
    assert (labels != owner).mean() < 0.02
    strongest = np.argmax(image[..., 2::-1], axis=-1)
    plain = owner >= 0
    assert (strongest != owner)[plain].mean() < 0.05


def test_a_cube_that_is_sunk_in_the_floor_shows_what_is_above(write_map):
    floor = {"name": "f", "dimension": [90, 90, 1], "color": [1, 1, 1], "instances": [[0, 0, -0.5, 0]]}
    renderer = Renderer(crossing(write_map, (3, 0, -0.6, 0), block=[floor]), 160, 120, 0.9)
    red = renderer.labels(CameraPose.at(0, 0, 0.5))[0] == 0
    focal, rows = renderer.camera.focal, np.flatnonzero(red.any(axis=1))
    assert rows.max() + 1 == pytest.approx(60 + focal * 0.5 / 2.5, abs=1)
    assert rows.min() == pytest.approx(60 + focal * 0.1 / 3.5, abs=1)


def test_a_cube_through_a_wall_shows_on_both_sides(write_map):
    wall = {"name": "w", "dimension": [0.1, 9, 9], "color": [0, 0, 0], "instances": [[3, 0, 0, 0]]}
    renderer = Renderer(crossing(write_map, (3, 0, 0, 0.4), block=[wall]), 160, 120, 0.9)
    for x, yaw in ((0, 0), (6, math.pi)):
        assert (renderer.labels(CameraPose.at(x, 0, 0.5, yaw=yaw))[0] == 0).sum() > 300


@pytest.mark.thorough
def test_too_many_faces_are_not_cut_up_and_that_is_told(write_map, caplog):
    steps = 2 * MAX_FACES
    ring = [(math.cos(a), math.sin(a) * (1.2 + 0.1 * math.cos(3 * a))) for a in np.arange(steps) * 2 * math.pi / steps]
    lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in ring]
    lines += [f"f {i + 1} {(i + 1) % steps + 1} {(i + 1) % steps + 1 + steps} {i + 1 + steps}" for i in range(steps)]
    model = {"name": "m", "file": "m.obj", "color": [1, 0, 0], "instances": [[5, 0, 0, 0], [5.5, 0, 0, 0]]}
    scene = load_scene(write_map({"model": [model]}, {"m.obj": "\n".join(lines)}))
    Renderer(scene, 64, 48, 1.0).render(CameraPose.at(0, 0, 0.5))
    assert "2 models that intersect have" in caplog.text
