"""The picture of a drive: where things are drawn, whatever the drive."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dodo_dsl.report.trajectory import Ground, Way, draw

TRACK = Ground([((1.0, 1.0, 0.0), [(-0.5, 1.0), (90.0, 90.0)])], [("finish", [(-0.5, 7.0, 0.5, 7.0)])])


def picture(folder: Path, ground: Ground, path: list[tuple[float, float]]) -> NDArray[np.uint8]:
    draw(folder / "drive.png", ground, Way(roles={"finish": "goal"}), np.array(path), "passed")
    return np.asarray(cv2.imread(str(folder / "drive.png"), cv2.IMREAD_UNCHANGED), np.uint8)


def test_it_shows_the_drive_over_its_map_and_lies_if_it_is_tall(tmp_path: Path) -> None:
    shown = picture(tmp_path, TRACK, [(0.0, n / 10) for n in range(70)])
    assert shown.shape[1:] == (480, 4) and shown.shape[0] < 200
    for colour in ((67, 160, 46, 255), (247, 129, 47, 255), (0, 255, 255, 255)):  # path, goal, cone
        assert (shown == colour).all(axis=2).sum() > 10
    assert (shown[..., 3] == 0).mean() > 0.8, "transparent elsewhere"
    driven = np.nonzero((shown == (67, 160, 46, 255)).all(axis=2).any(axis=0))[0]
    assert driven.min() == pytest.approx(16, abs=3), "it begins on the left"


@pytest.mark.parametrize("path", [[(3.0, 4.0)], [(0.0, 0.0), (1e6, -1e6)]])
def test_any_drive_can_be_drawn(tmp_path: Path, path: list[tuple[float, float]]) -> None:
    assert picture(tmp_path, Ground(), path).shape[:2] <= (360, 480)
