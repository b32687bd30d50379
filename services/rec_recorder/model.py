"""A recording as it is written: frames one after the other."""

from pathlib import Path
from types import TracebackType
from typing import Self

from dodo_dsl.opendlv.envelope import Envelope, encode_frame


class RecordingError(ValueError):
    """A file that cannot become a recording."""


class Recording:
    """A new `.rec` file; a context manager.

    Nothing is held back in the process: whatever ends it, the file holds all frames written so far.
    Raises RecordingError for a file that is there, and where none can be made.
    """

    def __init__(self, path: Path) -> None:
        self.frames = 0
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise RecordingError(f"{path} is there already and is not overwritten") from None
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from None

    def write(self, envelope: Envelope) -> None:
        """Append an envelope as it was received; raises OSError when the disk takes no more."""
        left = memoryview(encode_frame(envelope))
        while left:
            left = left[self._file.write(left) :]
        self.frames += 1

    def close(self) -> None:
        """End the recording."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
