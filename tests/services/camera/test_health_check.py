import io
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from services.camera import health_check

BOARD = np.kron(np.indices((8, 8)).sum(0) % 2 * 255, np.ones((16, 16))).astype(np.uint8)


def check(source: str, ok: bool) -> dict[str, Any]:
    output = io.StringIO()
    code = health_check.main([f"--source={source}", "--width=128", "--height=128"], output)
    result: dict[str, Any] = json.loads(output.getvalue())
    assert (code, result["ok"]) == (int(not ok), ok), result
    return result


@pytest.mark.parametrize(
    ("picture", "words"),
    [(BOARD, ""), (BOARD // 255, "is it lit?"), (BOARD * 0 + 128, "is the lens covered?"), (None, "is not a camera")],
    ids=["good", "dark", "grey", "none"],
)
def test_a_picture_is_checked(
    tmp_path: Path, picture: "np.ndarray[tuple[int, int], np.dtype[np.uint8]]", words: str
) -> None:
    path = tmp_path / "picture.png"
    if picture is not None:
        cv2.imwrite(str(path), picture)
    result = check(str(path), ok=not words)
    assert words in result.get("reason", "") + result.get("error", "")
    assert ("error" in result) == (picture is None)
