"""A recording of pictures that keeps the newest ones."""

import logging
import os
from collections import deque
from pathlib import Path

from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError, encode_frame
from dodo_dsl.opendlv.recordings.writer import RecordingWriter
from services.rec_recorder.model import RecordingFileError

_PIECE = 1 << 20
_log = logging.getLogger(__name__)


class NewestPictures:
    """A new `.rec` file of at most ``max_size`` bytes, without its oldest quarter each time that it would be larger.

    What cannot be written is logged, and ends it: pictures decide no test. Raises RecordingFileError where no file can
    be made, and for one that exists.
    """

    def __init__(self, path: Path, max_size: int) -> None:
        self._path, self._max_size = path, max_size
        self.is_on = True
        self._sizes: deque[int] = deque()
        try:
            self._writer = RecordingWriter(path)
        except FileExistsError:
            raise RecordingFileError(f"{path} exists and is not overwritten") from None
        except OSError as error:
            raise RecordingFileError(f"{path} cannot be written: {error.strerror}") from None

    def write(self, envelope: Envelope) -> None:
        """Append a picture; oldest ones may go."""
        if not self.is_on:
            return
        try:
            self._append(encode_frame(envelope))
        except (FrameError, OSError) as error:
            self.is_on = False
            _log.warning("no more pictures are recorded: %s", error)

    @property
    def is_wanted(self) -> bool:
        """Whether the file is still there: who runs a test removes it as soon as the test has passed."""
        return self.is_on and self._path.exists()

    def close(self) -> None:
        """End the recording."""
        self._writer.close()

    def _append(self, frame: bytes) -> None:
        if len(frame) > self._max_size:
            raise FrameError(f"a picture has {len(frame)} bytes")
        if self._writer.size + len(frame) > self._max_size:
            self._shorten(len(frame))
        self._writer.write_frames((frame,))
        self._sizes.append(len(frame))

    def _shorten(self, needed: int) -> None:
        """Make room for ``needed`` bytes and more; the file is whole at any time."""
        gone = 0
        while self._sizes and self._writer.size - gone + needed > self._max_size * 3 // 4:
            gone += self._sizes.popleft()
        part = self._path.with_name(f".{self._path.name}.part")
        with os.fdopen(os.open(self._path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), "rb") as old:
            part.unlink(missing_ok=True)
            shorter = RecordingWriter(part)
            old.seek(gone)
            shorter.write_frames(iter(lambda: old.read(_PIECE), b""))
        self._writer.close()
        part.replace(self._path)
        self._writer = shorter
