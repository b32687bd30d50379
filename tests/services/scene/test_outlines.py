"""Outlines and rays against shapely, cuts of meshes against trimesh."""

import math

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.scene.outlines import Cut, Outlines, Place, slice_mesh

COORDINATES = st.integers(-400, 400).map(lambda number: number / 100)
ANGLES = st.floats(-math.pi, math.pi)


def directions(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def seen(segments, origin, direction, reach):
    """The distance to the nearest of the segments as shapely finds it."""
    ray = shapely.LineString([origin, origin + reach * direction])
    met = ray.intersection(shapely.MultiLineString(list(segments)))
    return float(shapely.Point(origin).distance(met)) if not met.is_empty else math.inf


@given(st.lists(arrays(np.float64, (3, 2, 2), elements=COORDINATES), min_size=1, max_size=6), ANGLES, st.floats(0.5, 9))
def test_rays_meet_what_shapely_says(bodies, angle, reach):
    origin, ray = np.array([0.003, -0.007]), directions(np.array([angle]))
    segments = np.concatenate(bodies)
    expected = seen(segments, origin, ray[0], reach)
    (found,) = Cut.of([(body, False) for body in bodies]).distances(np.array([origin]), ray, reach)
    ends = segments.reshape(-1, 2) - origin
    grazed = np.abs(ends @ np.array([-ray[0, 1], ray[0, 0]])).min() < 1e-6
    if not grazed and abs(expected - reach) > 1e-6:
        assert found == pytest.approx(expected, abs=1e-7)


@given(
    st.lists(arrays(np.float64, (3, 2, 2), elements=COORDINATES), min_size=1, max_size=6), ANGLES, st.floats(0.02, 1.57)
)
def test_a_sector_has_the_nearest_point_that_shapely_finds(bodies, angle, half):
    origin, axis = np.array([0.003, -0.007]), directions(np.array([angle]))
    rim = origin + 30 * directions(np.linspace(angle - half, angle + half, 9))
    part = shapely.MultiLineString(list(np.concatenate(bodies))).intersection(shapely.Polygon([origin, *rim]))
    expected = math.inf if part.is_empty else float(shapely.Point(origin).distance(part))
    (found,) = Cut.of([(body, False) for body in bodies]).nearest(np.array([origin]), axis, half, 20.0)
    (less,) = Cut.of([(body, False) for body in bodies]).nearest(np.array([origin]), axis, half - 1e-6, 20.0)
    (more,) = Cut.of([(body, False) for body in bodies]).nearest(np.array([origin]), axis, half + 1e-6, 20.0)
    if less == pytest.approx(more, abs=1e-3):  # nothing begins just at the edge
        assert found == pytest.approx(expected, abs=1e-6)


@given(st.integers(3, 12), st.floats(0.1, 2), ANGLES, COORDINATES, COORDINATES)
def test_what_is_inside_is_what_shapely_says(corners, radius, turn, x, y):
    around = turn + np.arange(corners) * 2 * math.pi / corners
    polygon = radius * directions(around)
    cut = Cut.of([(np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1), True)])
    shape = shapely.Polygon(polygon)
    if shape.boundary.distance(shapely.Point(x, y)) > 1e-9:
        assert cut.contains(np.array([[x, y]])).tolist() == [shape.contains(shapely.Point(x, y))]
    assert not Cut.of([(np.stack([polygon, polygon], axis=1), False)]).contains(np.zeros((1, 2))).any()


@pytest.mark.parametrize("height", [0.001, 0.13, 0.29])
def test_meshes_are_cut_as_trimesh_cuts_them(height):
    for mesh in (trimesh.creation.cone(0.1, 0.3, sections=13), trimesh.creation.annulus(0.1, 0.2, 0.6)):
        found = slice_mesh(mesh.vertices, mesh.faces, height)
        lines = trimesh.intersections.mesh_plane(mesh, [0, 0, 1], [0, 0, height])[:, :, :2]
        ours, theirs = (shapely.union_all(shapely.linestrings(part)) for part in (found, lines))
        assert ours.length == pytest.approx(theirs.length)
        assert ours.hausdorff_distance(theirs) < 1e-9


def test_blocks_turn_as_the_camera_draws_them(write_map):
    block = {
        "name": "b",
        "dimension": [2, 0.2, 1],
        "color": [1, 0, 0],
        "instances": [[3, 0, 0.5, math.pi - math.pi / 6]],
    }
    cut = Outlines(write_map({"block": [block]})).at(0.5)
    expected = shapely.affinity.translate(shapely.affinity.rotate(shapely.box(-1, -0.1, 1, 0.1), 30), 3, 0)
    found = shapely.polygonize([shapely.LineString([a, a + e]) for a, e in zip(cut.starts, cut.edges, strict=True)])
    assert found.geoms[0].symmetric_difference(expected).area < 1e-9


def test_walls_are_obstacles_that_are_named(write_map):
    content = {"obstacles": [{"name": "wall", "lines": [[2, -1, 2, -0.05], [2, 0.05, 2, 1]]},
                             {"name": "finish", "lines": [[1, -1, 1, 1]]}]}  # fmt: skip
    cut = Outlines(write_map(content), ["wall"]).at(0.1)
    angles = np.array([0.0, 0.04, -0.04])
    assert cut.distances(np.zeros((3, 2)), directions(angles), 6.0).tolist() == pytest.approx(
        [math.inf, 2 / math.cos(0.04), 2 / math.cos(0.04)]
    ), "through the hole and beside it"
    every = Outlines(write_map(content), ["*"]).at(0.1)
    assert every.distances(np.zeros((1, 2)), directions(np.zeros(1)), 6.0).tolist() == [1.0], "the finish, too"
    rest = Outlines(write_map(content), ["*"], not_walls=["finish", "elsewhere"]).at(0.1)
    assert rest.distances(np.zeros((1, 2)), directions(np.zeros(1)), 6.0).tolist() == [math.inf], "through the hole"


def test_what_moves_stands_at_its_frame_and_the_vehicle_is_not_seen(write_map, cube_obj):
    model = {"name": "car", "file": "cube.obj", "color": [1, 0, 0], "frames": [0, 4]}
    outlines = Outlines(write_map({"model": [model]}, {"cube.obj": cube_obj}), own=0)
    assert list(outlines.moving) == [4]
    (cut,) = outlines.bodies_at(0.5, {0: Place(0, 0, 0, 0), 4: Place(5.0, 0.0, 0.0, math.pi / 4)})
    assert cut.distances(np.zeros((1, 2)), np.array([[1.0, 0.0]]), 9.0)[0] == pytest.approx(5 - math.sqrt(2))
    assert not list(outlines.bodies_at(0.5, {}))
    (gone,) = outlines.bodies_at(0.5, {4: Place(5.0, 0.0, 3.0, 0.0)})
    assert not len(gone.starts), "it flies above"
