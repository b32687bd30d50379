"""The recorder on the bus."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from dodo_dsl.opendlv.envelope import Envelope
from services.base import Context, Service
from services.base.lockstep_clock import RECORDING_END
from services.base.service import period_of
from services.rec_recorder.model import RecordingFile, Traffic
from services.rec_recorder.source import MemorySpec, PictureSource, parse

if TYPE_CHECKING:
    from services.rec_recorder.pictures import Cameras, RecordedCamera
    from services.rec_recorder.snapshot import SnapshotWriter

LOOKS_HZ, SNAPSHOT_LOOKS_HZ = 200.0, 20.0
"""Times a second at most that memories are looked at."""
FAST_LOOKS = 4
"""Looks a picture at most where the newest pictures are kept, of which none has to be exactly in time."""
WAITING = 32_000_000
"""Bytes of pictures that wait to be encoded: 69 of 640 x 480 pixels, which take a third of a second at the end."""
GATHERS = 0.01
"""Seconds in which messages may gather, in real time: to wake for each one costs more than to record it."""
COMMAND = "cluon.data.RecorderCommand"
MEGABYTE = 1_000_000


class Recorder(Service):
    """Records every envelope, and pictures if there are cameras."""

    period = None
    has_begun = False

    def __init__(
        self,
        recording: RecordingFile,
        cameras: "Cameras | None",
        snapshot: "SnapshotWriter | None",
        commands: bool,
        looks_hz: float = LOOKS_HZ,
    ) -> None:
        self.observe = recording.write
        self._recording, self._cameras, self._snapshot = recording, cameras, snapshot
        if cameras is not None:
            self.period = period_of(looks_hz)
        elif snapshot is not None:
            self.period = period_of(SNAPSHOT_LOOKS_HZ)
        if commands:
            self.inputs = {(COMMAND, None): self._command}

    def begin(self, now: int) -> None:
        self.has_begun = True
        if self._snapshot is not None:
            self._snapshot.begin()

    def update(self, now: int) -> tuple[()]:
        if self._cameras is not None:
            self._cameras.update(now)
        if self._snapshot is not None:
            self._snapshot.update(now)
        return ()

    def _command(self, message: Any, _sample_time: int) -> None:
        self._recording.command(message.command)


def build(context: Context) -> Service:
    """The service from its flags; the recording is closed at the end. PyAV and OpenCV are loaded only for pictures."""
    flags = context.flags
    memories = [parse(text) for text in flags["memories"]]
    for name in ("frames", "snapshot"):
        if flags[name] and not memories:
            raise ValueError(f"--{name} needs --memories: the names of the shared memories to record")
    if flags["pictures"] and not flags["frames"]:
        raise ValueError("--pictures needs --frames: the rate of the pictures")
    max_size = flags["max-size"] and round(flags["max-size"] * MEGABYTE)
    recording = RecordingFile(Path(flags["rec"]), max_size, _traffic(context))
    context.resources.callback(recording.close)
    if context.session is not None:
        context.session.gather(GATHERS)
    if flags["paused"]:
        recording.is_on = False
    period, is_stepped = flags["frames"] and round(period_of(flags["frames"])), context.clock.relays
    sources = [PictureSource(spec, period, is_stepped=is_stepped) for spec in memories if flags["frames"]]
    cameras = _cameras(context, sources, recording) if sources else None
    snapshot = _snapshot(context, Path(flags["snapshot"]), memories[0]) if flags["snapshot"] else None
    recorder = Recorder(recording, cameras, snapshot, flags["commands"], _looks_hz(context))
    context.resources.callback(_end, recorder, recording, context)
    return recorder


def _traffic(context: Context) -> Traffic:
    session, messages = context.session, context.messages

    def name(id_: int) -> str:
        return messages.name(id_) if id_ in messages.ids() else f"message {id_}"

    limit = round(context.flags["limit"] * MEGABYTE)
    now = None if context.clock.relays else context.clock.now
    return Traffic(limit, now, lambda: session.lost if session else 0, name)


def _looks_hz(context: Context) -> float:
    """How often memories are looked at; in lockstep a picture waits for the step that it belongs to."""
    rate: float = context.flags["frames"]
    if not (rate and context.flags["pictures"]):
        return LOOKS_HZ
    return min(LOOKS_HZ, rate if context.clock.relays else max(FAST_LOOKS * rate, SNAPSHOT_LOOKS_HZ))


def _end(recorder: Recorder, recording: RecordingFile, context: Context) -> None:
    """Record when the test ended, which nothing else shows if no more messages came."""
    if recorder.has_begun:
        now = context.clock.now()
        recording.write(Envelope(context.messages.id(RECORDING_END), b"", now, 0, now, 0))


def _snapshot(context: Context, path: Path, memory: MemorySpec) -> "SnapshotWriter":
    from services.rec_recorder.snapshot import SnapshotWriter

    snapshot = SnapshotWriter(PictureSource(memory, 1), path)
    context.resources.callback(snapshot.close)
    return snapshot


def _cameras(context: Context, sources: list[PictureSource], recording: RecordingFile) -> "Cameras":
    from services.rec_recorder.pictures import Cameras, Quality, RecordedCamera

    flags = context.flags
    is_alone = bool(flags["pictures"])
    quality = Quality(flags["key-interval"], flags["quality"], flags["lossless"], fast=is_alone)
    each = [RecordedCamera(source, quality, flags["id"] + number) for number, source in enumerate(sources)]
    cameras = (
        _pictures_alone(context, each, recording)
        if is_alone
        else Cameras(each, lambda camera, taken: recording.write(camera.envelope(taken)), lambda: recording.is_on)
    )
    context.resources.callback(cameras.close)
    return cameras


def _pictures_alone(context: Context, cameras: "list[RecordedCamera]", recording: RecordingFile) -> "Cameras":
    """Pictures in their own recording, of which the newest stay."""
    from services.rec_recorder.model import NewestPictures
    from services.rec_recorder.pictures import Cameras, Later

    size = round(context.flags["pictures-size"] * MEGABYTE)
    newest = NewestPictures(Path(context.flags["pictures"]), size)
    context.resources.callback(newest.close)
    later = Later(newest.write, lambda: newest.is_wanted, WAITING)
    context.resources.callback(later.close)
    return Cameras(cameras, later.add, lambda: recording.is_on and newest.is_on, required=False)
