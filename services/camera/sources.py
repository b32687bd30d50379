"""Sources of pictures: a camera, read in a thread so that the service never waits, and files, repeated.

A V4L2 device is read through OpenCV, the camera of a Raspberry Pi as raw I420 from the pipe of ``rpicam-vid``. Files
are an image, a video or a recording.
"""

import contextlib
import os
import select
import shutil
import stat
import subprocess
import threading
import time
from collections.abc import Iterator
from itertools import chain, repeat
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.picture_size import too_large
from dodo_dsl.opendlv.pixels import Picture as Image
from dodo_dsl.opendlv.pixels import converted
from dodo_dsl.opendlv.recording import read_envelopes
from services.scene.textures import load_picture


class CameraError(RuntimeError):
    """The camera gives no pictures any more; one sentence."""


class SharedPicture(NamedTuple):
    """In both of OpenDLV's formats, with the time (us since the epoch) at which it was taken, unless from a file."""

    argb: Image
    i420: Image
    time: int | None = None


def from_bgr(bgr: Image, width: int, height: int, time: int | None = None) -> SharedPicture:
    """The picture of B, G, R (any height, any width, 3), scaled if it has another size."""
    if bgr.shape[:2] != (height, width):
        smaller = bgr.shape[0] * bgr.shape[1] > height * width
        way = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        bgr = np.asarray(cv2.resize(bgr, (width, height), interpolation=way), np.uint8)
    return SharedPicture(converted(bgr, "bgr", "argb"), converted(bgr, "bgr", "i420"), time)


RECORDING = ".rec"
_SIDES = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)


class FileCamera:
    """One picture of the file for each ``take``, in order, and from the first again after the last."""

    def __init__(self, path: Path, width: int, height: int) -> None:
        """Pictures are scaled to ``width`` and ``height``; raises ValueError or OSError for a file without any."""
        if not path.is_file():
            raise OSError(f"there is no file '{path}'")
        self._size, pictures = (width, height), repeated(path)
        first = next(pictures, None)
        if first is None:
            raise ValueError(f"{path} has no pictures, expected an image, a video or a recording")
        self._pictures: Iterator[Image] = chain([first], pictures)

    def take(self) -> SharedPicture:
        return from_bgr(next(self._pictures), *self._size)

    def close(self) -> None:
        self._pictures = iter(())


def repeated(path: Path) -> Iterator[Image]:
    """The pictures of a file, as B, G, R, again and again; none of one that has none. Raises InputError."""
    if cv2.haveImageReader(str(path)):
        yield from repeat(load_picture(path))
    is_there = True
    while is_there:
        is_there = False
        for picture in recorded(path) if path.suffix == RECORDING else filmed(path):
            is_there = True
            yield picture


def filmed(path: Path) -> Iterator[Image]:
    capture: Any = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        if problem := too_large(*(round(capture.get(side)) for side in _SIDES)):
            raise ValueError(f"{path}: {problem}")
        while (found := capture.read())[0]:
            yield np.asarray(found[1], np.uint8)
    finally:
        capture.release()


def recorded(path: Path) -> Iterator[Image]:
    """The pictures of an OpenDLV recording's first camera, as B, G, R; raises ValueError if none can be decoded."""
    from dodo_dsl.opendlv import video

    messages, decoder, sender = MessageSet.standard(), None, None
    for envelope in read_envelopes(path):
        sender = envelope.sender_stamp if sender is None and envelope.data_type == IMAGE else sender
        if (envelope.data_type, envelope.sender_stamp) == (IMAGE, sender):
            reading = messages.decode(IMAGE, envelope.payload)
            video.refuse_large(reading.width, reading.height)
            decoder = decoder or video.VideoDecoder(reading.format)
            frame = decoder.decode(reading.data)
            if frame is not None:
                yield frame.pixels("bgr")


SILENCE = 1.5
"""s without a picture after which a camera that gave some counts as lost."""
FIRST = 5.0
"""s within which a camera has to give its first picture, because it has to be set up."""


def longest_silence(freq: float, exposure: float) -> float:
    """s between two pictures of a live camera at a rate in Hz, each exposed for ``exposure`` s, with a reserve."""
    return max(SILENCE, 2 * exposure, 2 / freq)


JOIN_PATIENCE = 2.0


class Grabber:
    """Keeps the newest picture of a camera; ``name`` names it in errors."""

    def __init__(self, camera: "Camera", name: str, silence: float = SILENCE) -> None:
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


MANUAL = 1
EXPOSURE_UNIT = 1e-4
"""V4L2_CID_EXPOSURE_ABSOLUTE counts in 100 us."""
TOLERANCE = 0.1
"""Share by which the exposure may differ from what was asked for."""
PATIENCE = 2.0


class V4l2Camera:
    """``read`` waits for a picture."""

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
        """Reads back what was set; raises ValueError with a hint if the device has something else."""
        get, device = self._capture.get, self._device
        size = int(get(cv2.CAP_PROP_FRAME_WIDTH)), int(get(cv2.CAP_PROP_FRAME_HEIGHT))
        if size != (self._width, self._height):
            found = f"the camera {device} gives pictures of {size[0]} x {size[1]}, not {self._width} x {self._height}"
            raise ValueError(f"{found}: set a size that 'v4l2-ctl -d {device} --list-formats-ext' lists")
        exposed = get(cv2.CAP_PROP_EXPOSURE) * EXPOSURE_UNIT
        if abs(exposed - exposure) > TOLERANCE * exposure:
            found = f"the camera {device} exposes for {max(exposed, 0.0):g} s, not {exposure:g} s"
            raise ValueError(f"{found}: set an exposure that 'v4l2-ctl -d {device} --list-ctrls' allows")


PROGRAM = "rpicam-vid"
ALIGNED = 64
"""Rows of other widths are padded in the pipe."""
END_PATIENCE = 0.4
"""s for which a program that has closed its pipe may take to end, and so to say why."""


class RpiCamera:
    """Reads whole pictures; ``read`` waits for one, ``close`` ends the program and any waiting."""

    def __init__(self, width: int, height: int, freq: float, exposure: float) -> None:
        """``freq`` in Hz, ``exposure`` in s.

        Raises ValueError for a width that the pipe pads, OSError if there is no program.
        """
        if width % ALIGNED:
            raise ValueError(f"expected a width that is a multiple of {ALIGNED}, not {width}")
        if shutil.which(PROGRAM) is None:
            raise OSError(f"there is no program '{PROGRAM}' on PATH, expected it from the package rpicam-apps")
        self._shape, self._size = (height * 3 // 2, width), width * height * 3 // 2
        self._closed = threading.Event()
        self._process = subprocess.Popen(
            rpicam_command(width, height, freq, exposure),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        assert self._process.stdout is not None
        self._pipe = self._process.stdout.fileno()
        self._stderr_end, self._busy = b"", threading.Lock()
        self._stderr = threading.Thread(target=self._read_stderr, daemon=True)
        self._stderr.start()

    def read(self) -> SharedPicture:
        """The next picture, with the time at which it was complete; raises CameraError when there are no more."""
        data = bytearray()
        while len(data) < self._size:
            with self._busy:
                part = os.read(self._pipe, self._size - len(data)) if self._readable() else b""
            if not part:
                raise CameraError(self._why())
            data += part
        image = np.frombuffer(bytes(data), np.uint8).reshape(self._shape)
        return SharedPicture(converted(image, "i420", "argb"), image, time.time_ns() // 1000)

    def close(self) -> None:
        """End the program, with force where it does not go by itself."""
        self._closed.set()
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._stderr.join(PATIENCE)
        with self._busy:  # a reader sees that it is closed
            for pipe in (self._process.stdout, self._process.stderr):
                if pipe is not None:
                    pipe.close()

    def _readable(self) -> bool:
        """Wait for bytes or the end of the pipe, until ``close``."""
        while not self._closed.is_set():
            if select.select([self._pipe], [], [], 0.1)[0]:
                return True
        return False

    def _read_stderr(self) -> None:
        assert self._process.stderr is not None
        with contextlib.suppress(ValueError):
            for line in self._process.stderr:
                self._stderr_end = line.strip() or self._stderr_end

    def _why(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(END_PATIENCE)
        self._stderr.join(END_PATIENCE)
        words = self._stderr_end.decode("utf-8", "replace")
        return f"{PROGRAM} ended with code {self._process.returncode}" + (f": {words}" if words else "")


def rpicam_command(width: int, height: int, freq: float, exposure: float) -> list[str]:
    """``rpicam-vid``: no preview, no end, raw pictures on standard output, each exposed for ``exposure`` s."""
    size = ["--width", str(width), "--height", str(height)]
    rate = ["--framerate", f"{freq:g}", "--shutter", str(round(exposure * 1e6))]
    return [PROGRAM, "--nopreview", "--timeout", "0", "--codec", "yuv420", "--flush", *size, *rate, "--output", "-"]


Camera = V4l2Camera | RpiCamera
