import numpy as np
import pytest

from services.scene.camera import CameraPose, Pinhole
from services.scene.raster import SHIFT
from services.scene.shading import Group, Light, cut, gather, silhouettes, whole
from services.scene.shape import make_shape

CORNERS = np.array([[x, y, z] for z in (0.0, 1.0) for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))])
SIDES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
CUBE = make_shape(CORNERS, np.concatenate([SIDES[:, [0, 1, 2]], SIDES[:, [0, 2, 3]]]))
LIGHT = Light(np.array([-1.0, 0.0, 0.0]), 0.25, 0.75, True)


def seen(*positions: tuple[float, float, float], turns: float = 0.0) -> Group:
    """White cubes of 1 m before a camera at the origin, 0.5 m high, that looks along x; the light is behind it."""
    view = Pinhole(200, 100, 1.0).view(CameraPose.at(0, 0, 0.5))
    count = len(positions)
    return gather(view, CUBE, np.full(3, 200.0), np.array(positions), np.full(count, turns), LIGHT)


def test_a_cube_from_the_front_shows_its_front_face_in_full_light() -> None:
    ((piece,),) = whole(seen((5.0, 0.0, 0.0)))
    points, colour = piece
    assert colour == [200.0, 200.0, 200.0, 255.0]
    half = 0.5 * Pinhole(200, 100, 1.0).focal / 4.5
    corners = points.reshape(-1, 2) / (1 << SHIFT)
    assert corners.min(axis=0) == pytest.approx([99.5 - half, 49.5 - half], abs=0.6)
    assert corners.max(axis=0) == pytest.approx([99.5 + half, 49.5 + half], abs=0.6)


def test_a_turned_cube_shows_two_faces_shaded_by_their_cosines() -> None:
    (pieces,) = whole(seen((5.0, 0.0, 0.0), turns=np.pi / 6))
    shades = sorted(colour[0] for _, colour in pieces)
    assert shades == pytest.approx([200 * (0.25 + 0.75 * 0.5), 200 * (0.25 + 0.75 * np.cos(np.pi / 6))], abs=0.5)


def test_a_silhouette_has_one_piece_a_copy_between_the_shades_of_its_faces() -> None:
    copies = silhouettes(seen((5.0, 0.0, 0.0), (7.0, 2.0, 0.0), turns=np.pi / 6))
    assert [len(pieces) for pieces in copies] == [1, 1]
    assert all(125 < colour[0] < 180 for pieces in copies for _, colour in pieces)


def test_a_cube_at_the_edge_is_cut_to_the_frustum() -> None:
    (pieces,) = cut(seen((1.0, 1.0, 0.0)))
    corners = np.concatenate([points.reshape(-1, 2) for points, _ in pieces]) / (1 << SHIFT)
    assert corners.min() >= -1.5 and corners[:, 0].max() <= 201 and corners[:, 1].max() <= 101
    assert cut(seen((-5.0, 0.0, 0.0))) == [[]]
