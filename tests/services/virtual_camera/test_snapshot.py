"""A snapshot of a scene with its truth, as a program."""

import json
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import cv2
import pytest

from services.virtual_camera.snapshot import main

SIZE = ("--width=640", "--height=480")


def snapshot(*words: str) -> tuple[int, dict[str, Any]]:
    stdout = StringIO()
    return main(words, stdout), json.loads(stdout.getvalue())


def test_the_boxes_hold_what_the_picture_shows(cube_at: Callable[..., Path], tmp_path: Path) -> None:
    folder, output = cube_at([4, 0.5, 0, 0]), tmp_path / "snapshot.png"
    code, said = snapshot(f"--map-path={folder}", f"--output={output}", "--z=0.5", *SIZE, "--truth-classes=cube=box")
    assert (code, said["width"], said["height"]) == (0, 640, 480)
    (box,) = said["boxes"]
    assert box["class"] == "box"
    picture = cv2.imread(str(output))
    rows, columns = ((picture[..., 2] > 100) & (picture[..., 0] < 50)).nonzero()
    edges = (box["x"], box["x"] + box["width"], box["y"], box["y"] + box["height"])
    assert edges == pytest.approx((columns.min(), columns.max() + 1, rows.min(), rows.max() + 1), abs=1.5)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--truth-classes=cone=x",), "there is no model 'cone' in the map"),
        (("--fovi=3",), "--fovi=3"),
        (("--output=again.png",), "expected --output=FILE once"),
    ],
)
def test_what_gives_no_snapshot(
    cube_at: Callable[..., Path], tmp_path: Path, words: tuple[str, ...], sentence: str
) -> None:
    given = (f"--map-path={cube_at([4, 0, 0, 0])}", f"--output={tmp_path / 'snapshot.png'}")
    found, said = snapshot(*given, *words)
    assert found == 2 and sentence in said["error"]
    assert not (tmp_path / "snapshot.png").exists()
