from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from services.scene.camera import CameraPose, Pinhole, still
from services.scene.lens import Alignment, Distortion, Lens, lens_of
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.virtual_camera.optics import Optics

CAMERA = Pinhole(160, 120, 1.0)


@settings(deadline=None)
@given(st.floats(-0.2, 0.4), st.floats(-0.1, 0.2), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02))
@pytest.mark.thorough
def test_the_polynomial_is_opencvs_and_is_inverted(k1, k2, p1, p2):
    distortion = Distortion(k1, k2, p1, p2)
    points = np.random.RandomState(3).uniform(-0.6, 0.6, (50, 2))
    shown = distortion.forward(points)
    solid = np.column_stack([points, np.ones(50)])
    theirs = cv2.projectPoints(solid, np.zeros(3), np.zeros(3), np.eye(3), np.array([k1, k2, p1, p2]))[0]
    assert shown == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)
    assert distortion.backward(shown) == pytest.approx(points, abs=1e-4)


@pytest.mark.parametrize("k1", [-0.15, 0.3])
def test_a_picture_shows_points_where_the_lens_puts_them(k1):
    lens = Lens(CAMERA, Distortion(k1))
    ideal = np.zeros((lens.wide.height, lens.wide.width, 4), np.uint8)
    out = np.zeros((120, 160, 4), np.uint8)
    spots = lens.wide.centre + np.array([[-50.5, -30.5], [40.5, 20.5], [0.5, 45.5]])
    for u, v in spots.astype(int):
        cv2.circle(ideal, (int(u), int(v)), 3, (255, 255, 255, 255), cv2.FILLED)
    lens.apply(ideal, out)
    _, _, _, found = cv2.connectedComponentsWithStats((out[..., 0] > 128).astype(np.uint8))
    expected = lens.shown(spots.astype(int).astype(float))
    assert sorted(found[1:].tolist()) == [pytest.approx(spot, abs=0.6) for spot in sorted(expected.tolist())]


def edge_of(image):
    """The highest row that is not sky, in each column."""
    return np.argmax((image[..., :3] == 255).all(axis=-1), axis=0)


@pytest.mark.parametrize("k1", [-0.15, 0.3])
def test_straight_lines_bend_as_the_polynomial_says(cube_at, k1):
    """The far edge of a white floor, well above the middle."""
    scene, pose = load_scene(cube_at([60, 60, 0, 0])), CameraPose.at(40, 0, 1, pitch=0.45)
    straight = edge_of(Renderer(scene, 160, 120, 1.0).render(pose))
    assert np.ptp(straight) <= 1
    optics = Optics(CAMERA, Distortion(k1))
    out = np.empty((120, 160, 4), np.uint8)
    renderer = Renderer(scene, optics.wide.width, optics.wide.height, optics.wide.fovy)
    optics.expose(renderer, still(pose), CameraPose.at(0, 0, 0), 0, out)
    across = np.linspace(-1.2, 1.2, 500)
    line = np.column_stack([across, np.full(500, (straight[80] - 59.5) / CAMERA.focal)])
    u, v = (Distortion(k1).forward(line) * CAMERA.focal + CAMERA.centre).T
    expected = np.interp(np.arange(160), u, v)
    assert np.ptp(expected) > 2
    assert edge_of(out) == pytest.approx(expected, abs=1.3)


@pytest.mark.parametrize("bad", [Distortion(-2.0), Distortion(-0.9, 0.1), Distortion(p1=0.9)])
def test_what_folds_the_picture_is_refused(bad):
    with pytest.raises(ValueError, match="its distortion folds the picture"):
        Lens(CAMERA, bad)


def test_no_distortion_is_no_lens():
    assert Optics(CAMERA, Distortion()).lens is None
    assert lens_of(CAMERA, Distortion(), Alignment()) is None


@pytest.mark.parametrize("lens", [Distortion(), Distortion(-0.12, 0.05, 0.001, -0.002)], ids=["ideal", "real"])
def test_the_camera_matrix_is_opencvs(lens: Distortion) -> None:
    fx, cx, cy = 125.0, 84.25, 55.5
    made = Lens(CAMERA, lens, Alignment(fx, cx, cy))
    points = np.random.RandomState(3).uniform(-0.4, 0.4, (50, 2))
    matrix = np.array([[fx, 0, cx], [0, CAMERA.focal, cy], [0, 0, 1]])
    solid = np.column_stack([points, np.ones(50)])
    coefficients = np.array([lens.k1, lens.k2, lens.p1, lens.p2])
    theirs = cv2.projectPoints(solid, np.zeros(3), np.zeros(3), matrix, coefficients)[0]
    shown = made.shown(points * made.wide.focal + made.wide.centre)
    assert shown == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


def test_a_centre_that_is_off_shifts_the_picture(cube_at: Callable[[list[float]], Path]) -> None:
    """By whole pixels, exactly."""
    scene, pose = load_scene(cube_at([3, 0.4, 0, 0.3])), CameraPose.at(0, 0, 0.5, pitch=0.1)

    def picture(alignment: Alignment) -> NDArray[np.uint8]:
        optics = Optics(CAMERA, alignment=alignment)
        out = np.empty((120, 160, 4), np.uint8)
        renderer = Renderer(scene, optics.wide.width, optics.wide.height, optics.wide.fovy)
        optics.expose(renderer, still(pose), CameraPose.at(0, 0, 0), 0, out)
        return out

    middle, off = picture(Alignment(CAMERA.focal)), picture(Alignment(None, 79.5 + 7, 59.5 - 4))
    difference = np.abs(middle[4:, :-7].astype(int) - off[:-4, 7:])
    assert np.ptp(middle[..., :3]) > 50 and difference.max() <= 1


@pytest.mark.parametrize("bad", [Alignment(centre_x=-500.0), Alignment(focal_x=30.0)])
def test_what_needs_a_much_wider_picture_is_refused(bad: Alignment) -> None:
    with pytest.raises(ValueError, match="the lens is too far from an ideal one"):
        Lens(CAMERA, Distortion(), bad)
