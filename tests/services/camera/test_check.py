"""Whether a camera is alive and lit, as a process that looks at a picture."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.services.process import ROOT

BOARD = np.kron(np.indices((8, 8)).sum(0) % 2 * 255, np.ones((16, 16))).astype(np.uint8)


@pytest.mark.parametrize(
    ("picture", "words"),
    [(BOARD, ""), (BOARD // 255, "is it lit?"), (BOARD * 0 + 128, "is the lens covered?"), (None, "is no camera")],
    ids=["good", "dark", "grey", "none"],
)
def test_a_picture_is_judged(
    tmp_path: Path, picture: "np.ndarray[tuple[int, int], np.dtype[np.uint8]]", words: str
) -> None:
    path = tmp_path / "picture.png"
    if picture is not None:
        cv2.imwrite(str(path), picture)
    command = [sys.executable, "-m", "services.camera.check", f"--source={path}", "--width=128", "--height=128"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=30)
    said = json.loads(result.stdout)
    assert (result.returncode, said["ok"]) == (int(bool(words)), not words)
    assert words in said.get("reason", "") + said.get("error", "")
