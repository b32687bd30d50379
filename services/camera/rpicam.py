"""The camera of a Raspberry Pi: raw I420 from the pipe of ``rpicam-vid``."""

import contextlib
import os
import select
import shutil
import subprocess
import threading
import time

import numpy as np

from services.camera.picture import CameraError, SharedPicture, from_i420

PROGRAM = "rpicam-vid"
ALIGNED = 64
"""Rows of other widths are padded in the pipe."""
PATIENCE = 2.0
END_PATIENCE = 0.4
"""s for which a program that has closed its pipe may take to end, and so to say why."""


class RpiCamera:
    """Reads whole pictures; ``read`` waits for one, ``close`` ends the program and any waiting."""

    def __init__(self, width: int, height: int, freq: float, exposure: float) -> None:
        """``freq`` in Hz, ``exposure`` in s.

        Raises ValueError for a width that the pipe pads, OSError where there is no program.
        """
        if width % ALIGNED or height % 2:
            raise ValueError(
                f"expected a width that is a multiple of {ALIGNED} and an even height, not {width} x {height}"
            )
        if shutil.which(PROGRAM) is None:
            raise OSError(f"there is no program '{PROGRAM}' on PATH, expected it from the package rpicam-apps")
        self._shape, self._size = (height * 3 // 2, width), width * height * 3 // 2
        self._closed = threading.Event()
        self._process = subprocess.Popen(
            argv(width, height, freq, exposure),
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
        return from_i420(image, time.time_ns() // 1000)

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
        """Keep the end of the program's log, which says why it ended."""
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


def argv(width: int, height: int, freq: float, exposure: float) -> list[str]:
    """The command: no preview, no end, raw pictures on standard output, each exposed for ``exposure`` s."""
    size = ["--width", str(width), "--height", str(height)]
    rate = ["--framerate", f"{freq:g}", "--shutter", str(round(exposure * 1e6))]
    return [PROGRAM, "--nopreview", "--timeout", "0", "--codec", "yuv420", "--flush", *size, *rate, "--output", "-"]
