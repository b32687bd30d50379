"""A part of a recording, copied into a new recording byte for byte."""

from collections.abc import Callable
from pathlib import Path

from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.opendlv.recordings.writer import RecordingWriter


def write(recording: Recording, rows: Numbers, path: Path, progress: Callable[[int], None]) -> None:
    """Writes rows unchanged into a new file; ``progress`` gets the number of rows done.

    Raises OSError and RecordingError.
    """
    with RecordingWriter(path) as writer:
        for batch in recording.batches(rows):
            writer.write_frames(batch.frames())
            progress(writer.frames)
