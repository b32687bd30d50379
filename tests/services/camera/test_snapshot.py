import io
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from services.camera.health_check import main
from tests.services.camera.test_health_check import BOARD


def snapshot(*words: str) -> tuple[int, dict[str, Any]]:
    output = io.StringIO()
    return main(words, output), json.loads(output.getvalue())


@pytest.mark.parametrize(("divisor", "reason"), [(1, ""), (255, "is it lit?")])
def test_a_snapshot_is_the_cameras_picture(tmp_path: Path, divisor: int, reason: str) -> None:
    source, output = tmp_path / "board.png", tmp_path / "snapshot.png"
    cv2.imwrite(str(source), BOARD // divisor)
    code, result = snapshot(f"--source={source}", "--width=128", "--height=128", f"--output={output}")
    assert (code, result["ok"], result["width"], result["height"]) == (0, not reason, 128, 128)
    assert reason in result["reason"]
    assert np.array_equal(cv2.imread(str(output)), np.dstack([BOARD // divisor] * 3))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--source=/nowhere.png", "--output=OUT"), "is not a camera"),
        (("--source=/nowhere.png", "--output=a", "--output=b"), "expected --output=FILE once"),
        (("--source=file", "--fil=x", "--output=OUT"), "--fil=x"),
    ],
)
def test_what_gives_no_snapshot(tmp_path: Path, words: tuple[str, ...], sentence: str) -> None:
    output = tmp_path / "snapshot.png"
    code, result = snapshot(*(word.replace("OUT", str(output)) for word in words))
    assert code == 1 and sentence in result["error"]
    assert not output.exists()
