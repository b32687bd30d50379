"""The memories to record, and pictures taken from them without being one of their readers."""

import functools
import logging
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

RETRY = 200_000
PATIENCE, STEPPED_PATIENCE = 0.05, 2.0
"""Seconds to wait for a memory's lock; in lockstep nothing is lost by waiting for a reader that gets no processor."""
COMMON_SIZES = (
    (320, 240), (640, 360), (640, 480), (800, 600), (1024, 768), (1280, 720), (1280, 960), (1280, 1024),
    (1640, 1232), (1920, 1080), (2592, 1944), (3280, 2464),
)  # fmt: skip

HALF_BYTES = {"argb": 8, "bgr": 6, "i420": 3, "rgb": 6}  # twice the bytes per pixel
_WRITTEN = re.compile(r"(?P<name>[^:]+)(:(?P<width>[1-9][0-9]{0,4})x(?P<height>[1-9][0-9]{0,4}))?")
_log = logging.getLogger(__name__)
_say_once = functools.cache(_log.info)


class SourceError(ValueError):
    """A wrong name of a memory, or one without a picture; one sentence."""


@dataclass(frozen=True)
class MemorySpec:
    """A memory to record, and the size of its pictures if it is known (else 0 x 0)."""

    name: str
    width: int = 0
    height: int = 0

    def layout(self, size: int) -> tuple[str, int, int]:
        """Format, width and height of the pictures in a memory of `size` bytes; raises SourceError."""
        kinds = sorted(HALF_BYTES, key=lambda kind: not re.search(f"(?<!a){kind}", self.name))  # one in the name first
        for kind in kinds:
            for width, height in ((self.width, self.height),) if self.width else COMMON_SIZES:
                if width * height * HALF_BYTES[kind] // 2 == size:
                    if not self.width:
                        _say_once("assuming that memory '%s' has %d x %d pixels of %s", self.name, width, height, kind)
                    return kind, width, height
        common, given = (
            f"common size: write {self.name}:WIDTHxHEIGHT",
            f"picture of {self.width} x {self.height} pixels",
        )
        raise SourceError(f"memory '{self.name}' has {size} bytes, not those of a {given if self.width else common}")


def parse(text: str) -> MemorySpec:
    """`name` or `name:640x480`; raises SourceError."""
    match = _WRITTEN.fullmatch(text)
    if match is None:
        raise SourceError(
            f"'{text}' is not a memory to record, expected a name such as video0.i420 or video0.i420:640x480"
        )
    return MemorySpec(match["name"], int(match["width"] or 0), int(match["height"] or 0))


class PictureSource:
    """The newest picture of a memory, at most one each `period` microseconds of its own sample times.

    It polls the memory and never waits for a notification, so that a camera that counts its readers does not see it.
    What is in the memory at first is skipped: it may not be a picture yet; in lockstep (``is_stepped``) it is one
    if it has a sample time of the test.
    """

    def __init__(
        self,
        spec: MemorySpec,
        period: int,
        attach: Callable[[str], SharedMemory] | None = None,
        is_stepped: bool = False,
    ) -> None:
        self.spec = spec
        self._is_stepped = is_stepped
        self._patience = STEPPED_PATIENCE if is_stepped else PATIENCE
        self._period = period
        self._attach = attach or SharedMemory.attach
        self._memory: SharedMemory | None = None
        self._retry = 0
        self._last = 0
        self._due: int | None = None

    @property
    def size(self) -> int:
        """Bytes of the memory, 0 while there is none."""
        return self._memory.size if self._memory else 0

    def take(self, now: int) -> tuple[bytes, int] | None:
        """The bytes and the sample time of a picture that is due and was not taken yet."""
        try:
            if self._memory is None and not self._found(now):
                return None
            assert self._memory is not None
            with self._memory.lock(self._patience):
                time = self._memory.sample_time()
                is_picture = not self._is_stepped or time <= now
                return (bytes(self._memory.buffer), time) if is_picture and self._is_due(time) else None
        except SharedMemoryError as error:
            _log.debug("no picture of '%s': %s", self.spec.name, error)
            if self._memory is None or not self._memory.is_there:
                self.close()
                self._retry = now + RETRY
            return None

    def skip(self) -> None:
        """Skip the picture that is there now."""
        if self._memory is not None:
            with suppress(SharedMemoryError), self._memory.lock(self._patience):
                self._last, self._due = self._memory.sample_time(), None

    def close(self) -> None:
        """Detach from the memory."""
        if self._memory is not None:
            self._memory.close()
            self._memory = None

    def _found(self, now: int) -> bool:
        if now < self._retry:
            return False
        memory = self._attach(self.spec.name)
        try:
            with memory.lock(self._patience):
                self._last, self._due = 0 if self._is_stepped else memory.sample_time(), None
        except SharedMemoryError:
            memory.close()
            raise
        self._memory = memory
        return True

    def _is_due(self, time: int) -> bool:
        """Pictures are taken on a grid of times, a tenth of the period early at most; it starts again after a jump."""
        if time == self._last:
            return False
        jumped = self._due is None or time < self._last or time - self._due > 10 * self._period
        self._last = time
        due = time if jumped or self._due is None else self._due
        if time < due - self._period // 10:
            return False
        while due <= time + self._period // 10:
            due += self._period
        self._due = due
        return True
