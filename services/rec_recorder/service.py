"""The recorder on the bus."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from services.base import Context, Service
from services.base.service import period_of
from services.rec_recorder.model import Recording
from services.rec_recorder.source import Source, parse

if TYPE_CHECKING:
    from services.rec_recorder.pictures import Cameras

LOOKS_HZ = 200.0
COMMAND = "cluon.data.RecorderCommand"
MEGABYTE = 1_000_000


class Recorder(Service):
    """Records every envelope that comes, whatever its message, and pictures where there are cameras."""

    period = None

    def __init__(self, recording: Recording, cameras: "Cameras | None", commands: bool) -> None:
        self.observe = recording.write
        self._recording, self._cameras = recording, cameras
        if cameras is not None:
            self.period = period_of(LOOKS_HZ)
        if commands:
            self.inputs = {(COMMAND, None): self._command}

    def update(self, now: int) -> tuple[()]:
        if self._cameras is not None:
            self._cameras.update(now)
        return ()

    def _command(self, message: Any, _sample_time: int) -> None:
        self._recording.command(message.command)


def build(context: Context) -> Service:
    """The service from its flags; the recording is closed at the end. PyAV is loaded only for frames."""
    flags = context.flags
    memories = [parse(text) for text in flags["memories"]]
    if flags["frames"] and not memories:
        raise ValueError("--frames needs --memories: the names of the shared memories to record")
    max_size = flags["max-size"] and round(flags["max-size"] * MEGABYTE)
    recording = context.resources.enter_context(Recording(Path(flags["rec"]), max_size))
    if flags["paused"]:
        recording.is_on = False
    sources = [Source(wanted, period_of(flags["frames"])) for wanted in memories if flags["frames"]]
    return Recorder(recording, _cameras(context, sources, recording) if sources else None, flags["commands"])


def _cameras(context: Context, sources: list[Source], recording: Recording) -> "Cameras":
    from services.rec_recorder.pictures import Camera, Cameras, Quality

    flags = context.flags
    quality = Quality(flags["key-interval"], flags["quality"], flags["lossless"])
    cameras = Cameras(
        [Camera(source, quality, context.messages, flags["id"] + number) for number, source in enumerate(sources)],
        recording.write,
        lambda: recording.is_on,
    )
    context.resources.callback(cameras.close)
    return cameras
