"""Reads a camera in a thread, so that the service never waits for it."""

import threading
import time
from typing import Protocol

from services.camera.picture import CameraError, SharedPicture

SILENCE = 1.5
"""s without a picture after which a camera that gave some counts as lost."""
FIRST = 5.0
"""s within which a camera has to give its first picture, as it has to be set up."""


def longest_silence(freq: float, exposure: float) -> float:
    """s between two pictures of a live camera at a rate in Hz, each exposed for ``exposure`` s, with a reserve."""
    return max(SILENCE, 2 * exposure, 2 / freq)


JOIN_PATIENCE = 2.0


class Camera(Protocol):
    """Where pictures come from."""

    def read(self) -> SharedPicture:
        """The next picture; raises CameraError when there are no more."""
        ...

    def close(self) -> None:
        """Close the camera."""
        ...


class Grabber:
    """Keeps the newest picture of a camera; ``name`` names it in errors."""

    def __init__(self, camera: Camera, name: str, silence: float = SILENCE) -> None:
        self._camera, self._name, self._silence = camera, name, silence
        self._changed = threading.Condition()
        self._newest: SharedPicture | None = None
        self._error: Exception | None = None
        self._closed = False
        self._last = time.monotonic()
        self._thread = threading.Thread(target=self._grab, daemon=True)
        self._thread.start()

    def wait(self, timeout: float) -> bool:
        """Whether the first picture or an error has come within ``timeout`` seconds."""
        with self._changed:
            return self._changed.wait_for(lambda: self._newest is not None or self._error is not None, timeout)

    def take(self) -> SharedPicture | None:
        """The newest picture, once; raises CameraError when the camera is lost or silent."""
        with self._changed:
            picture, self._newest = self._newest, None
            error, last = self._error, self._last
        if picture is not None:
            return picture
        if error is not None:
            raise error
        if time.monotonic() - last > self._silence:
            raise CameraError(f"the camera {self._name} gave no picture for {self._silence:g} s")
        return None

    def close(self) -> None:
        """Close the camera, without waiting long for one that hangs."""
        self._closed = True
        self._camera.close()
        self._thread.join(JOIN_PATIENCE)

    def _grab(self) -> None:
        while not self._closed:
            try:
                picture = self._camera.read()
            except Exception as error:  # noqa: BLE001 - it ends the service from the service's own thread
                with self._changed:
                    self._error = error
                    self._changed.notify_all()
                return
            with self._changed:
                self._newest, self._last = picture, time.monotonic()
                self._changed.notify_all()
