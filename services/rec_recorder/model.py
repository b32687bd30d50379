"""A recording that is written: frames in order, up to a size, while recording is on."""

import logging
from pathlib import Path
from types import TracebackType
from typing import Self

from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError, encode_frame
from dodo_dsl.opendlv.recordings.writer import RecordingWriter
from services.rec_recorder.traffic import FloodError, Traffic

RECORD, STOP = 1, 2

_log = logging.getLogger(__name__)


class RecordingFileError(ValueError):
    """A file that cannot become a recording, or a disk that is full."""


class RecordingFile:
    """A new `.rec` file; a context manager. Once it has `max_size` bytes it takes no more messages, and logs that.

    ``traffic`` counts what it takes. Nothing is buffered in the process: whatever ends it, the file holds all frames
    written so far.
    Raises RecordingError for a file that exists, and where none can be made.
    """

    def __init__(self, path: Path, max_size: int | None = None, traffic: Traffic | None = None) -> None:
        self.is_on = True
        self._traffic = traffic
        self.left_out = 0
        self._max_size = max_size
        try:
            self._writer = RecordingWriter(path)
        except FileExistsError:
            raise RecordingFileError(f"{path} exists and is not overwritten") from None
        except OSError as error:
            raise RecordingFileError(f"{path} cannot be written: {error.strerror}") from None

    @property
    def frames(self) -> int:
        """How many frames were written."""
        return self._writer.frames

    def command(self, command: int) -> None:
        """RecorderCommand: 1 records from the next message on, 2 stops; others are logged and ignored."""
        if command not in (RECORD, STOP):
            _log.warning("unknown recorder command %d, expected 1 to record or 2 to stop", command)
            return
        self.is_on = command == RECORD
        _log.info("recording %s with %d messages", "resumed" if self.is_on else "stopped", self.frames)

    def write(self, envelope: Envelope) -> None:
        """Append an envelope as it was received.

        Raises RecordingFileError when the disk takes no more, and FloodError at the limits of ``traffic``, upon which
        recording ends.
        """
        if not self.is_on:
            return
        try:
            frame = encode_frame(envelope)
        except FrameError as error:  # larger than a frame can be
            self._leave_out(str(error))
            return
        if self._max_size is not None and self._writer.size + len(frame) > self._max_size:
            self._leave_out(f"the recording has its largest size, {self._max_size} bytes")
            return
        self._count(envelope, len(frame))
        try:
            self._writer.write_frames((frame,))
        except OSError as error:
            place = f"{self._writer.path} ends after {self.frames} messages"
            raise RecordingFileError(f"{place}: {error.strerror}") from None

    def close(self) -> None:
        """End the recording."""
        if self.left_out:
            _log.warning("%d messages were not recorded", self.left_out)
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _count(self, envelope: Envelope, size: int) -> None:
        try:
            if self._traffic is not None:
                self._traffic.add(envelope, size)
        except FloodError:
            self.is_on = False
            raise

    def _leave_out(self, reason: str) -> None:
        if not self.left_out:
            _log.warning("a message was not recorded: %s", reason)
        self.left_out += 1
