"""The recorder on the bus."""

from pathlib import Path

from services.base import Context, Service
from services.rec_recorder.model import Recording


class Recorder(Service):
    """Records every envelope that comes, whatever its message."""

    period = None

    def __init__(self, recording: Recording) -> None:
        self.observe = recording.write


def build(context: Context) -> Service:
    """The service from its flags; the recording is closed at the end."""
    return Recorder(context.resources.enter_context(Recording(Path(context.flags["rec"]))))
