"""A V4L2 device, through OpenCV."""

import stat
import threading
import time
from pathlib import Path
from typing import Any

import cv2

from services.camera.picture import CameraError, SharedPicture, from_bgr

MANUAL = 1
EXPOSURE_UNIT = 1e-4
"""V4L2_CID_EXPOSURE_ABSOLUTE counts in 100 us."""
TOLERANCE = 0.1
"""Share by which exposure and rate may differ from what was asked for."""
PATIENCE = 2.0


class V4l2Camera:
    """``read`` waits for a picture; ``notes`` tell of a rate other than asked for."""

    def __init__(self, device: Path, width: int, height: int, freq: float, exposure: float) -> None:
        """``freq`` in Hz, ``exposure`` in s.

        Raises OSError for a device that is not a camera, ValueError for one that has no such pictures.
        """
        if not device.exists():
            raise OSError(f"there is no camera {device}; is it plugged in?")
        if not stat.S_ISCHR(device.stat().st_mode):
            raise OSError(f"{device} is not a V4L2 device")
        self._busy = threading.Lock()
        self._device, self._width, self._height = device, width, height
        self._capture: Any = cv2.VideoCapture(str(device), cv2.CAP_V4L2)
        if not self._capture.isOpened():
            raise OSError(f"the camera {device} cannot be opened; does another program use it?")
        wanted = {
            cv2.CAP_PROP_FRAME_WIDTH: float(width),
            cv2.CAP_PROP_FRAME_HEIGHT: float(height),
            cv2.CAP_PROP_FPS: freq,
            cv2.CAP_PROP_BUFFERSIZE: 1.0,
            cv2.CAP_PROP_AUTO_EXPOSURE: float(MANUAL),
            cv2.CAP_PROP_EXPOSURE: exposure / EXPOSURE_UNIT,
        }
        for key, value in wanted.items():
            self._capture.set(key, value)
        try:
            self._compare(exposure)
        except ValueError:
            self._capture.release()
            raise
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        differs = abs(rate - freq) > TOLERANCE * freq
        self.notes = [f"{device} refuses the rate of {freq:g} Hz and has {rate:g}"] if differs else []

    def read(self) -> SharedPicture:
        """The next picture, with the time at which it was complete; raises CameraError when the device is lost."""
        with self._busy:
            good, image = self._capture.read()
        now = time.time_ns() // 1000
        if not good or image is None:
            raise CameraError(f"the camera {self._device} gives no pictures any more; is it still plugged in?")
        return from_bgr(image, self._width, self._height, now)

    def close(self) -> None:
        """Close the device unless it hangs; its driver does so at the end of the process."""
        if self._busy.acquire(timeout=PATIENCE):
            self._capture.release()
            self._busy.release()

    def _compare(self, exposure: float) -> None:
        """Reads back what was set; raises ValueError with the way out where the device has something else."""
        get, device = self._capture.get, self._device
        size = int(get(cv2.CAP_PROP_FRAME_WIDTH)), int(get(cv2.CAP_PROP_FRAME_HEIGHT))
        if size != (self._width, self._height):
            found = f"the camera {device} gives pictures of {size[0]} x {size[1]}, not {self._width} x {self._height}"
            raise ValueError(f"{found}: set a size that 'v4l2-ctl -d {device} --list-formats-ext' lists")
        exposed = get(cv2.CAP_PROP_EXPOSURE) * EXPOSURE_UNIT
        if abs(exposed - exposure) > TOLERANCE * exposure:
            found = f"the camera {device} exposes for {max(exposed, 0.0):g} s, not {exposure:g} s"
            raise ValueError(f"{found}: set an exposure that 'v4l2-ctl -d {device} --list-ctrls' allows")
