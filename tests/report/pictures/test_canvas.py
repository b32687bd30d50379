"""The plot of a drive: where things are drawn, whatever the drive and the texts."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.trajectory import DrivenPath, Ground
from dodo_dsl.report.trajectory_plot import Axes, Canvas, draw, thinned

OUTCOME = Outcome("test", "test", "t.dodo.yml", "sil", "closed-loop", "passed", "all", 130, 0, "lockstep", "process")


def drawn(canvas: Canvas) -> list[int]:
    """The first and last row, and the first and last column, of what is not white."""
    rows, columns = np.nonzero((canvas.pixels < 200).any(axis=2))
    return [int(edge) for places in (rows, columns) for edge in (places.min(), places.max())]


def test_the_scale_is_the_same_in_both_directions() -> None:
    for points, place in (
        ([(0.0, 3.0), (0.5, 3.0)], [130, 130, 150, 200]),
        ([(0.0, 3.0), (0, 3.5)], [80, 130, 150, 150]),
    ):
        canvas = Canvas(300, 300)
        Axes(canvas, 50, 30, (-1.0, 2.0), (1.0, 4.0), 100.0).line(points, (255, 0, 0), 2)
        assert drawn(canvas) == pytest.approx(place, abs=2)


def test_what_lies_outside_of_the_axes_is_not_drawn() -> None:
    canvas = Canvas(200, 200)
    axes = Axes(canvas, 50, 50, (0.0, 0.0), (1.0, 1.0), 100.0)
    axes.line([(0.5, 0.5), (1e9, 0.5)], (0, 0, 0), 2)
    axes.dot((-3.0, 0.5), 40.0, (0, 0, 0), (9, 9, 9))
    assert drawn(canvas)[2:] == [pytest.approx(100, abs=2), 149]


def test_a_long_text_is_wrapped_at_words() -> None:
    canvas, text = Canvas(1, 1), "from here to there and back again, " * 4
    lines = list(canvas.wrapped(text, 14, 200.0))
    assert " ".join(lines) == text.strip() and len(lines) > 3
    assert max(canvas.text_width(line, 14) for line in lines) <= 200


def test_a_line_is_thinned_to_its_ends() -> None:
    points = [(n / 1000, 0.0) for n in range(1001)]
    assert thinned(points, 0.3) == [(0.0, 0.0), (0.3, 0.0), (0.6, 0.0), (0.9, 0.0), (1.0, 0.0)]
    assert set(thinned(points[:1], 0.3)) == set(points[:1])


def picture(tmp_path: Path, drive: DrivenPath, outcome: Outcome = OUTCOME) -> NDArray[np.uint8]:
    draw(drive, outcome, tmp_path / "drive.png")
    return np.asarray(cv2.imread(str(tmp_path / "drive.png")), np.uint8)


def test_the_plot_shows_the_drive_over_its_map(tmp_path: Path) -> None:
    cones, goal = ((1.0, 1.0, 0.0), [(-0.5, 1.0), (90.0, 90.0)]), ("finish", [(-0.5, 2.0, 0.5, 2.0)])
    drive = DrivenPath([(0.0, n / 10, 1.57, n / 10) for n in range(20)], Ground([cones], [goal]), 0.4, 0.2, "finish")
    shown = picture(tmp_path, drive)
    assert shown.shape == (770, 770, 3)
    for colour in ((55, 127, 26), (235, 111, 31), (0, 255, 255)):  # path, goal, cone
        assert (shown == colour).all(axis=2).sum() > 10


@pytest.mark.parametrize("path", [[(3.0, 4.0, 0.0, 0.0)], [(0.0, 0.0, 0.0, 0.0), (1e6, -1e6, 2.0, 60.0)]])
@pytest.mark.parametrize("reason", ["", "x" * 5000, "word " * 2000, "naïve 日本 \ud800 \x1b[31m"])
def test_any_drive_can_be_drawn(tmp_path: Path, path: list[tuple[float, float, float, float]], reason: str) -> None:
    outcome = Outcome(**{**vars(OUTCOME), "reason": reason})
    assert picture(tmp_path, DrivenPath(path, Ground(), 0.4, 0.2), outcome).shape[:2] <= (770, 770)
