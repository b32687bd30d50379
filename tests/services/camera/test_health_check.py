"""Whether a camera is alive and lit, as a process that looks at a picture."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.services.process import ROOT

BOARD = np.kron(np.indices((8, 8)).sum(0) % 2 * 255, np.ones((16, 16))).astype(np.uint8)


@pytest.mark.parametrize(
    ("picture", "words"),
    [(BOARD, ""), (BOARD // 255, "is it lit?"), (BOARD * 0 + 128, "is the lens covered?"), (None, "is not a camera")],
    ids=["good", "dark", "grey", "none"],
)
def test_a_picture_is_judged(
    tmp_path: Path, picture: "np.ndarray[tuple[int, int], np.dtype[np.uint8]]", words: str
) -> None:
    path = tmp_path / "picture.png"
    if picture is not None:
        cv2.imwrite(str(path), picture)
    result = check(str(path), ok=not words)
    assert words in result.get("reason", "") + result.get("error", "")
    assert ("error" in result) == (picture is None)


def check(source: str, ok: bool) -> dict[str, Any]:
    command = [
        sys.executable,
        "-m",
        "services.camera.health_check",
        f"--source={source}",
        "--width=128",
        "--height=128",
    ]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=30)
    result: dict[str, Any] = json.loads(result.stdout)
    assert (result.returncode, result["ok"]) == (int(not ok), ok), result
    return result


@pytest.mark.usefixtures("rpicam")
@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("lit", ""),
        ("dark", "is it lit?"),
        ("frozen", "has shown the same picture for 5 s"),
        ("lost", "rpicam-vid ended with code 1"),
    ],
)
def test_a_live_camera_is_judged_when_it_has_settled(monkeypatch: pytest.MonkeyPatch, mode: str, words: str) -> None:
    """It is dark at first, as it finds its exposure."""
    monkeypatch.setenv("FAKE_MODE", mode)
    assert words in check("rpicam", ok=not words).get("reason", "")


def test_a_camera_that_is_not_there_cannot_be_judged() -> None:
    assert "/dev/video99" in check("/dev/video99", ok=False)["error"]
