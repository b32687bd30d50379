"""Writing recordings so that whatever ends the writer, the file holds all frames written so far."""

import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import Self

from dodo_dsl.opendlv.envelope import Envelope, encode_frame

_TOGETHER = 16


class RecordingWriter:
    """A new ``.rec`` file; a context manager. Nothing is held back in the process.

    Each call appends whole frames with one write of the kernel; what a full disk cut off is taken back. Raises
    FileExistsError for a file that is there, OSError if none can be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.frames = 0
        self.size = 0
        self._file = path.open("xb", buffering=0)

    def write(self, envelope: Envelope) -> None:
        """Appends an envelope unchanged; raises FrameError if it fits in none, OSError when the disk is full."""
        self.write_frames((encode_frame(envelope),))

    def write_frames(self, frames: Iterable[bytes]) -> None:
        rest = iter(frames)
        while some := list(itertools.islice(rest, _TOGETHER)):
            self._append(some)

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _append(self, frames: list[bytes]) -> None:
        data = b"".join(frames)
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            self._file.truncate(self.size)
            self._file.seek(self.size)
            raise
        self.size += len(data)
        self.frames += len(frames)
