"""What a V4L2 device is asked for and gives: a stand-in for OpenCV's capture answers as drivers do."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from services.camera.sources import CameraError, V4l2Camera

DEVICE = Path("/dev/null")


class Capture:
    """A device that keeps what is set, but for ``fixed`` values, and gives two pictures."""

    def __init__(self, fixed: dict[int, float]) -> None:
        self.values: dict[int, float] = {}
        self.fixed, self.left, self.released = fixed, 2, False

    def isOpened(self) -> bool:
        return True

    def set(self, key: int, value: float) -> bool:
        self.values[key] = value
        return key not in self.fixed

    def get(self, key: int) -> float:
        return self.fixed.get(key, self.values.get(key, 0.0))

    def read(self) -> tuple[bool, Any]:
        self.left -= 1
        return (True, np.full((48, 64, 3), 90, np.uint8)) if self.left >= 0 else (False, None)

    def release(self) -> None:
        self.released = True


def opened(monkeypatch: pytest.MonkeyPatch, fixed: dict[int, float]) -> Capture:
    capture = Capture(fixed)
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: capture)
    return capture


def test_settings_are_set_and_the_camera_is_unplugged(monkeypatch: pytest.MonkeyPatch) -> None:
    capture = opened(monkeypatch, {})
    camera = V4l2Camera(DEVICE, 64, 48, 10, 0.1)
    assert capture.get(cv2.CAP_PROP_EXPOSURE) == 1000
    assert capture.get(cv2.CAP_PROP_AUTO_EXPOSURE) == 1
    assert camera.read().argb.shape == camera.read().argb.shape == (48, 64, 4)
    with pytest.raises(CameraError, match="gives no pictures any more; is it still plugged in"):
        camera.read()
    camera.close()
    assert capture.released


@pytest.mark.parametrize(
    ("fixed", "problem"),
    [
        ({cv2.CAP_PROP_FRAME_WIDTH: 1280, cv2.CAP_PROP_FRAME_HEIGHT: 720}, "gives pictures of 1280 x 720, not 64 x 48"),
        ({cv2.CAP_PROP_EXPOSURE: 156}, "exposes for 0.0156 s, not 0.1 s: set an exposure that 'v4l2-ctl"),
        ({cv2.CAP_PROP_EXPOSURE: -1}, "exposes for 0 s, not 0.1 s"),
    ],
)
def test_what_the_device_refuses(monkeypatch: pytest.MonkeyPatch, fixed: dict[int, float], problem: str) -> None:
    capture = opened(monkeypatch, fixed)
    with pytest.raises(ValueError, match=problem):
        V4l2Camera(DEVICE, 64, 48, 10, 0.1)
    assert capture.released


def test_no_camera(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"there is no camera .*; is it plugged in"):
        V4l2Camera(tmp_path / "video0", 64, 48, 10, 0.1)
    (tmp_path / "video0").touch()
    with pytest.raises(OSError, match="is not a V4L2 device"):
        V4l2Camera(tmp_path / "video0", 64, 48, 10, 0.1)
