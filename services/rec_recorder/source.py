"""The memories to record, and pictures taken from them without being one of their readers."""

import functools
import logging
import re
from dataclasses import dataclass
from functools import partial

from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base.polled_memory import PolledMemory

PATIENCE, STEPPED_PATIENCE = 0.05, 2.0
"""Seconds to wait for a memory's lock; in lockstep nothing is lost by waiting for a reader that gets no processor."""
COMMON_SIZES = (
    (320, 240), (640, 360), (640, 480), (800, 600), (1024, 768), (1280, 720), (1280, 960), (1280, 1024),
    (1640, 1232), (1920, 1080), (2592, 1944), (3280, 2464),
)  # fmt: skip

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
        from dodo_dsl.opendlv.pixels import HALF_BYTES

        kinds = sorted(HALF_BYTES, key=lambda kind: not re.search(f"(?<!a){kind}", self.name))  # one in the name first
        for kind in kinds:
            for width, height in ((self.width, self.height),) if self.width else COMMON_SIZES:
                if width * height * HALF_BYTES[kind] // 2 == size:
                    if not self.width:
                        _say_once("assuming that memory '%s' has %d x %d pixels of %s", self.name, width, height, kind)
                    return kind, width, height
        given = f"picture of {self.width} x {self.height} pixels"
        wanted = given if self.width else f"common size: write {self.name}:WIDTHxHEIGHT"
        raise SourceError(f"memory '{self.name}' has {size} bytes, not those of a {wanted}")


def parse(text: str) -> MemorySpec:
    """`name` or `name:640x480`; raises SourceError."""
    match = _WRITTEN.fullmatch(text)
    if match is None:
        raise SourceError(
            f"'{text}' is not a memory to record, expected a name such as video0.i420 or video0.i420:640x480"
        )
    return MemorySpec(match["name"], int(match["width"] or 0), int(match["height"] or 0))


class PictureSource(PolledMemory):
    """The newest picture of a memory, at most one each `period` microseconds of its own sample times.

    In lockstep (``is_stepped``) what is in it at first is a picture if it has a sample time of the test.
    """

    def __init__(self, spec: MemorySpec, period: int, is_stepped: bool = False) -> None:
        super().__init__(spec.name, STEPPED_PATIENCE if is_stepped else PATIENCE, is_first_taken=is_stepped)
        self.spec = spec
        self._is_stepped, self._period = is_stepped, period
        self._due: int | None = None

    def take(self, now: int) -> tuple[bytes, int] | None:
        """The bytes and the sample time of a picture that is due and was not taken yet."""
        return self.poll(now, partial(self._taken, now))

    def pass_over(self, time: int) -> None:
        self.last, self._due = time, None

    def _taken(self, now: int, memory: SharedMemory, time: int) -> tuple[bytes, int] | None:
        is_picture = not self._is_stepped or time <= now
        return (bytes(memory.buffer), time) if is_picture and self._is_due(time) else None

    def _is_due(self, time: int) -> bool:
        """Pictures are taken on a grid of times, a tenth of the period early at most; it starts again after a jump."""
        if time == self.last:
            return False
        jumped = self._due is None or time < self.last or time - self._due > 10 * self._period
        self.last = time
        due = time if jumped or self._due is None else self._due
        if time < due - self._period // 10:
            return False
        while due <= time + self._period // 10:
            due += self._period
        self._due = due
        return True
