"""Intrinsics from pictures of the board: those of a known camera, and pictures that are not enough."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from dodo_dsl.run.rigs import camera_calibration
from dodo_dsl.run.rigs.axis_calibration import CalibrationProblem
from dodo_dsl.run.rigs.camera_calibration import BoardView, intrinsics, view
from tests.calibration.board_pictures import HEIGHT, LENS, MATRIX, WIDTH, pictures


@cache
def views() -> list[BoardView]:
    return [seen for seen in map(view, pictures()) if seen]


@pytest.mark.thorough
def test_a_known_camera_comes_back() -> None:
    found = intrinsics(views())
    assert (found.width, found.height, found.pictures) == (WIDTH, HEIGHT, 9)
    assert (found.focal_x, found.focal_y) == pytest.approx((MATRIX[0, 0], MATRIX[1, 1]), rel=0.002)
    assert (found.centre_x, found.centre_y) == pytest.approx((MATRIX[0, 2], MATRIX[1, 2]), abs=1)
    corner = np.array([[[0.6, 0.45, 1.0]]])
    lens = np.array([found.k1, found.k2, found.p1, found.p2])
    matrix = np.array([[found.focal_x, 0, found.centre_x], [0, found.focal_y, found.centre_y], [0, 0, 1]])
    none = np.zeros(3)
    places = [cv2.projectPoints(corner, none, none, *camera)[0].ravel() for camera in ((matrix, lens), (MATRIX, LENS))]
    assert np.hypot(*(places[0] - places[1])) < 0.5, "px in the picture's corner"
    assert found.error < 0.2 and found.deviation < 1 and found.fovy == pytest.approx(48.87, abs=0.1)


@pytest.mark.thorough
def test_pictures_that_are_not_enough_are_refused() -> None:
    good = views()
    with pytest.raises(CalibrationProblem, match="5 pictures show the board, expected at least 6"):
        intrinsics(good[:5])
    with pytest.raises(CalibrationProblem, match="sizes of 320 x 240 and 640 x 480"):
        intrinsics([*good, replace(good[0], size=(320, 240))])
    with pytest.raises(CalibrationProblem, match="% of the picture's width, expected 60 %"):
        intrinsics([replace(each, seen=each.seen / 2) for each in good])
    with pytest.raises(CalibrationProblem, match="px off, and 1 px are allowed"):
        bent = [replace(each, seen=each.seen + np.float32(9) * (each.corners[..., :2] > 0.1)) for each in good]
        intrinsics(bent)
    with pytest.raises(CalibrationProblem, match="tilted against the others in 0 pictures"):
        middle = np.array([WIDTH / 2, HEIGHT / 2], np.float32)
        intrinsics([replace(good[0], seen=middle + np.float32(1.4) * (good[0].seen - middle))] * 6)
    assert view(np.full((HEIGHT, WIDTH, 3), 200, np.uint8)) is None


def test_the_board_is_drawn_in_true_size() -> None:
    root = ET.fromstring(camera_calibration.svg())
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("297mm", "210mm", "0 0 297 210")
    ink = sum(
        float(part[part.index("h") + 1 : part.index("v")]) * float(part[part.index("v") + 1 :].split("h")[0])
        for part in root.findall("{*}path")[0].get("d", "").split("z")[:-1]
    )
    assert ink == pytest.approx((camera_calibration.board_picture(2) == 0).sum() / 4)
