"""Intrinsics from pictures of the board: those of a known camera, and pictures that are not enough."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from dodo_dsl.run.rigs import calibration
from dodo_dsl.run.rigs.calibration import BoardView, CalibrationProblem, intrinsics, view
from tests.calibration.board_pictures import HEIGHT, LENS, MATRIX, WIDTH, pictures

SVG = Path(__file__).parents[2] / "docs" / "rigs" / "board.svg"


@cache
def views() -> list[BoardView]:
    return [seen for seen in map(view, pictures()) if seen]


@pytest.mark.thorough
def test_a_known_camera_comes_back() -> None:
    found = intrinsics(views())
    focal, centre = (found["focal-x"], found["focal-y"]), (found["centre-x"], found["centre-y"])
    assert (found["width"], found["height"]) == (WIDTH, HEIGHT)
    assert focal == pytest.approx((MATRIX[0, 0], MATRIX[1, 1]), rel=0.002)
    assert centre == pytest.approx((MATRIX[0, 2], MATRIX[1, 2]), abs=1)
    lens = np.array([found[name] for name in ("k1", "k2", "p1", "p2")])
    matrix = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1]])
    corner, none = np.array([[[0.6, 0.45, 1.0]]]), np.zeros(3)
    places = [cv2.projectPoints(corner, none, none, *camera)[0].ravel() for camera in ((matrix, lens), (MATRIX, LENS))]
    assert np.hypot(*(places[0] - places[1])) < 0.5, "px in the picture's corner"
    assert found["error"] < 0.2 and found["fovy"] == pytest.approx(48.87, abs=0.1)


@pytest.mark.thorough
def test_pictures_that_are_not_enough_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    good = views()
    with pytest.raises(CalibrationProblem, match="% of the frame's width, expected 60 %"):
        intrinsics([replace(each, seen=each.seen / 2) for each in good])
    with pytest.raises(CalibrationProblem, match="px off, and 1 px are allowed"):
        bent = [replace(each, seen=each.seen + np.float32(9) * (each.corners[..., :2] > 0.1)) for each in good]
        intrinsics(bent)
    monkeypatch.setattr(calibration, "LEAST_CERTAIN", 1e-6)
    with pytest.raises(CalibrationProblem, match=r"is uncertain by .* px: tilt the board by 20 to 45 degrees"):
        intrinsics(good)
    assert view(np.full((HEIGHT, WIDTH), 200, np.uint8)) is None


def test_the_drawn_board_is_that_which_is_looked_for() -> None:
    text = SVG.read_text()
    assert 'width="297mm" height="210mm" viewBox="0 0 297 210"' in text
    drawn = np.full((420, 594), 255, np.uint8)
    for part in re.findall(r"M([\d.]+) ([\d.]+)h([\d.]+)v([\d.]+)h-[\d.]+z", text):
        x, y, width, height = (round(2 * float(number)) for number in part)
        drawn[y : y + height, x : x + width] = 0
    board = calibration.board().generateImage((504, 336))
    assert (drawn[42 : 42 + 336, 45 : 45 + 504] == board).all() or (drawn == 0).sum() == (board == 0).sum()
