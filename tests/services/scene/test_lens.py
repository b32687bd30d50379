import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.scene.camera import Pinhole
from services.scene.lens import Alignment, Distortion, Lens

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


@pytest.mark.parametrize("bad", [Distortion(-2.0), Distortion(-0.9, 0.1), Distortion(p1=0.9)])
def test_what_folds_the_picture_is_refused(bad):
    with pytest.raises(ValueError, match="its distortion folds the picture"):
        Lens(CAMERA, bad)


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


@pytest.mark.parametrize("bad", [Alignment(centre_x=-500.0), Alignment(focal_x=30.0)])
def test_what_needs_a_much_wider_picture_is_refused(bad: Alignment) -> None:
    with pytest.raises(ValueError, match="the lens is too far from an ideal one"):
        Lens(CAMERA, Distortion(), bad)
