"""Scans against shapely and triangles in space: walls, blocks, meshes, bodies that move, and the limits of range."""

import math

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.lidar.model import Lidar, Scanner
from services.scene.outlines import Cut, Outlines, Place

COORDINATES = st.integers(-400, 400).map(lambda number: number / 100)
ANGLES = st.floats(-math.pi, math.pi)
BODIES = st.lists(arrays(np.float64, (3, 2, 2), elements=COORDINATES), min_size=1, max_size=8)
EPSILON = 1e-6
ORIGIN = Place(0.0, 0.0, 0.0, 0.0)


def unit(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def along(shape, origin, angles, reach):
    """The distance on each ray to the nearest of a shape as shapely finds it."""
    met = shapely.intersection(shapely.linestrings([[origin, origin + reach * ray] for ray in unit(angles)]), shape)
    return np.where(shapely.is_empty(met), np.inf, shapely.distance(shapely.Point(origin), met))


@pytest.mark.thorough
@given(BODIES, ANGLES, st.floats(0.02, 1.0), st.integers(2, 4096), st.floats(0.5, 9))
def test_each_ray_meets_what_shapely_says(bodies, first, part, rays, reach):
    """In any field of view, also of more than half a turn, and where it goes on over the first ray."""
    origin, increment = np.array([0.003, -0.007]), part * math.tau / rays
    angles = first + increment * np.arange(rays)
    cuts = [Cut.of([(body, False) for body in some]) for some in (bodies[::2], bodies[1::2])]
    found = Cut.joined(cuts).scan(origin, unit(angles), increment, reach)
    segments = shapely.MultiLineString(list(np.concatenate(bodies)))
    nearer, farther = (along(segments.buffer(size), origin, angles, reach) for size in (EPSILON, 0))
    ends = np.concatenate(bodies).reshape(-1, 2) - origin
    off = np.abs(ends @ unit(angles + math.pi / 2).T).min(axis=0)
    sure = (off > 2 * EPSILON) & (np.isinf(nearer) == np.isinf(farther))  # neither an end nor the reach is grazed
    assert np.allclose(found[sure], farther[sure], atol=1e-7)


def along_triangles(triangles, origin, angles):
    """The distance on each ray in space to the nearest of the triangles (T, 3, 3), by Cramer's rule."""
    rays, (a, b, c) = np.column_stack([unit(angles), np.zeros(len(angles))])[:, None], triangles.swapaxes(0, 1)
    to, one, other = origin - a, b - a, c - a
    with np.errstate(divide="ignore", invalid="ignore"):  # by those that lie flat
        share = 1 / (np.cross(rays, other) * one).sum(axis=2)
        u, v = (share * (a * b).sum(axis=2) for a, b in ((np.cross(rays, other), to), (rays, np.cross(to, one))))
        distance = share * (other * np.cross(to, one)).sum(axis=1)
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance >= 0)
    return np.where(met, distance, np.inf).min(axis=1)


def put(mesh, x, y, z, turn):
    placed = mesh.copy().apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
    return placed.apply_translation([x, y, z]).triangles


def test_meshes_and_bodies_that_move_are_met_where_triangles_in_space_are(write_map):
    """Models turn as maps.md says, and those at frames as their frames; the own one is not seen."""
    ball, car = trimesh.creation.icosphere(2, 0.5), trimesh.creation.box([0.8, 0.4, 1.0])
    stands = [[2.0, 0.5, 0.2, 0.0], [-1.5, -1.0, 0.0, 1.0]]
    models = [
        {"name": "ball", "file": "ball.obj", "color": [1, 0, 0], "instances": stands},
        {"name": "car", "file": "car.obj", "color": [1, 0, 0], "frames": [3, 4, 0]},
    ]
    files = {f"{name}.obj": mesh.export(file_type="obj") for name, mesh in (("ball", ball), ("car", car))}
    scanner = Scanner(Outlines(write_map({"model": models}, files), own=0), Lidar(x=0.1, y=0.05, z=0.1, yaw=0.3))
    vehicle, (c, s) = Place(0.2, -0.1, 0.05, 0.7), (math.cos(0.7), math.sin(0.7))
    origin = np.array([0.2 + 0.1 * c - 0.05 * s, -0.1 + 0.1 * s + 0.05 * c, 0.15])
    angles = 1.0 - math.pi + math.tau / 360 * np.arange(360)
    still = [put(ball, x, y, z, math.pi - angle) for x, y, z, angle in stands]
    seen = []
    for places in ({3: Place(1.0, 1.5, 0.0, 0.4)}, {3: Place(-1.0, 1.5, 0.1, 2.0), 4: Place(0.5, -2.0, 0.0, 0.0)}):
        found = scanner.distances(vehicle, {0: vehicle, **places})
        moving = [put(car, x, y, z, yaw + math.pi / 2) for x, y, z, yaw in places.values()]
        expected = along_triangles(np.concatenate([*still, *moving]), origin, angles)
        assert np.allclose(found, np.where(expected > 12, np.inf, expected), atol=1e-6)
        seen.append(np.isfinite(found).sum())
    assert 60 < seen[0] < seen[1] < 300
    inside = {3: Place(0.5, 0.5, 0.0, 0.0), 4: Place(origin[0], origin[1], 0.0, 1.0)}
    assert not scanner.distances(vehicle, inside).any(), "from inside a car"


@pytest.fixture
def room(write_map):
    walls = [[-2, -3, 2, -3], [2, -3, 2, 3], [2, 3, -2, 3], [-2, 3, -2, -3]]
    post = {"name": "post", "dimension": [0.4, 0.4, 1], "color": [1, 0, 0], "instances": [[0, 1.0, 0.5, 0.0]]}
    return Outlines(write_map({"block": [post], "obstacles": [{"name": "walls", "lines": walls}]}), ["walls"])


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        ({"rays": 4}, [2.0, 3.0, 2.0, 0.8]),  # backwards, right, forward, left: the last is not the first again
        ({"rays": 5, "field_of_view": math.pi}, [3.0, 2 * math.sqrt(2), 2.0, 2 * math.sqrt(2), 0.8]),
        ({"rays": 4, "yaw": math.pi / 2}, [3.0, 2.0, 0.8, 2.0]),
        ({"rays": 4, "x": 0.5, "y": -1.0}, [2.5, 2.0, 1.5, 4.0]),
        ({"rays": 4, "far": 2.5}, [2.0, math.inf, 2.0, 0.8]),
        ({"rays": 4, "near": 1.0}, [2.0, 3.0, 2.0, -math.inf]),
        ({"rays": 2, "y": 1.0}, [-math.inf, -math.inf]),  # inside the post
        ({"rays": 4, "z": 1.5}, [2.0, 3.0, 2.0, 3.0]),  # above the post; walls have no height
    ],
)
def test_ranges(about, expected, room):
    assert Scanner(room, Lidar(**about)).ranges(ORIGIN, {}).tolist() == pytest.approx(expected, rel=1e-6)
