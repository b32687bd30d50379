import threading

import numpy as np
import pytest

from services.camera.sources import CameraError, Grabber, SharedPicture, from_bgr

PATIENCE = 20.0


class Scripted:
    """Gives pictures when told to; `None` loses the camera."""

    def __init__(self) -> None:
        self.told = threading.Semaphore(0)
        self.waits = threading.Semaphore(0)
        self.lost = False
        self.closed = False
        self.count = 0

    def read(self) -> SharedPicture:
        self.waits.release()
        self.told.acquire()
        if self.lost:
            raise CameraError("the cable is out")
        self.count += 1
        return from_bgr(np.zeros((2, 2, 3), np.uint8), 2, 2, self.count)

    def close(self) -> None:
        self.closed = self.lost = True
        self.told.release()

    def give(self, number: int = 1) -> None:
        """Let the camera have pictures taken, and wait until it waits for the next."""
        for _ in range(number):
            assert self.waits.acquire(timeout=PATIENCE)
            self.told.release()
        assert self.waits.acquire(timeout=PATIENCE)
        self.waits.release()


def test_the_newest_picture_is_given_once() -> None:
    camera = Scripted()
    grabber = Grabber(camera, "test")
    assert grabber.take() is None and not grabber.wait(0.0)
    camera.give(3)
    picture = grabber.take()
    assert picture is not None and picture.time == 3
    assert grabber.take() is None
    grabber.close()
    assert camera.closed


def test_a_lost_camera_is_told_after_its_last_picture() -> None:
    camera = Scripted()
    grabber = Grabber(camera, "test")
    camera.give()
    camera.lost = True
    camera.told.release()
    grabber._thread.join(PATIENCE)
    assert grabber.take() is not None
    with pytest.raises(CameraError, match="the cable is out"):
        grabber.take()
    grabber.close()


def test_a_silent_camera_is_lost_too() -> None:
    grabber = Grabber(Scripted(), "/dev/video9", silence=0.0)
    with pytest.raises(CameraError, match=r"the camera /dev/video9 gave no picture for 0 s"):
        while True:
            grabber.take()
    grabber.close()
