"""The recorder on the bus."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dodo_dsl.opendlv.envelope import Envelope
from services.base import Context, Service
from services.base.lockstep_clock import RECORDING_END
from services.base.service import period_of
from services.rec_recorder.model import NewestPictures, RecordingFile, Traffic
from services.rec_recorder.source import MemorySpec, PictureSource, parse

if TYPE_CHECKING:
    from services.rec_recorder.pictures import RecordedCamera, Snapshot

LOOKS_HZ, SNAPSHOT_LOOKS_HZ = 200.0, 20.0
"""Times a second at most that memories are looked at."""
FAST_LOOKS = 4
"""Looks a picture at most where the newest pictures are kept, of which none has to be exactly in time."""
WAITING = 128_000_000
"""Bytes of pictures that wait to be encoded: 277 of 640 x 480 pixels, which take some 1.3 s where a test fails."""
GATHERS = 0.01
"""Seconds in which messages may gather, in real time: to wake for each one costs more than to record it."""
MEGABYTE = 1_000_000


class Recorder(Service):
    """Records every envelope, and pictures if there are cameras."""

    period = None
    has_begun = False

    def __init__(
        self, recording: RecordingFile, cameras: "list[RecordedCamera]", snapshot: "Snapshot | None", looks_hz: float
    ) -> None:
        self.observe = recording.write
        self._snapshot = snapshot
        self._cameras: list[RecordedCamera | Snapshot] = [*cameras, *([snapshot] if snapshot else [])]
        if self._cameras:
            self.period = period_of(looks_hz)

    def begin(self, now: int) -> None:
        self.has_begun = True
        if self._snapshot is not None:
            self._snapshot.begin()

    def update(self, now: int) -> tuple[()]:
        for each in self._cameras:
            each.update(now)
        return ()


def build(context: Context) -> Service:
    """The service from its flags; the recording is closed at the end. PyAV and OpenCV are loaded only for pictures."""
    flags = context.flags
    for name in ("frames", "snapshot"):
        if flags[name] and not flags["memories"]:
            raise ValueError(f"--{name} needs --memories: the names of the shared memories to record")
    if flags["pictures"] and not flags["frames"]:
        raise ValueError("--pictures needs --frames: the rate of the pictures")
    memories = [parse(text) for text in flags["memories"]]
    recording = RecordingFile(Path(flags["rec"]), _traffic(context))
    context.resources.callback(recording.close)
    if context.session is not None:
        context.session.gather(GATHERS)
    cameras = _cameras(context, memories, recording) if flags["frames"] else []
    for camera in cameras:
        context.resources.callback(camera.close)
    snapshot = None
    if flags["snapshot"]:
        from services.rec_recorder.pictures import Snapshot

        snapshot = Snapshot(PictureSource(memories[0], 1), Path(flags["snapshot"]))
        context.resources.callback(snapshot.close)
    recorder = Recorder(recording, cameras, snapshot, _looks_hz(context))
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
    if not rate:
        return SNAPSHOT_LOOKS_HZ
    if not context.flags["pictures"]:
        return LOOKS_HZ
    return min(LOOKS_HZ, rate if context.clock.relays else max(FAST_LOOKS * rate, SNAPSHOT_LOOKS_HZ))


def _end(recorder: Recorder, recording: RecordingFile, context: Context) -> None:
    """Record when the test ended, which nothing else shows if no more messages came."""
    if recorder.has_begun:
        now = context.clock.now()
        recording.write(Envelope(context.messages.id(RECORDING_END), b"", now, 0, now, 0))


def _cameras(context: Context, memories: list[MemorySpec], recording: RecordingFile) -> "list[RecordedCamera]":
    """Pictures in the recording, or in one of their own, of which the newest stay."""
    from dodo_dsl.opendlv.video import VideoEncoder
    from services.rec_recorder.pictures import Later, RecordedCamera, Store

    flags = context.flags
    encoder = partial(
        VideoEncoder,
        key_interval=flags["key-interval"],
        quality=flags["quality"],
        lossless=flags["lossless"],
        fast=bool(flags["pictures"]),
    )
    store: Store = lambda camera, taken: recording.write(camera.envelope(taken))  # noqa: E731
    if flags["pictures"]:
        newest = NewestPictures(Path(flags["pictures"]), round(flags["pictures-size"] * MEGABYTE))
        context.resources.callback(newest.close)
        later = Later(newest.write, lambda: newest.is_wanted, WAITING)
        context.resources.callback(later.close)
        store = later.add
    period, required = round(period_of(flags["frames"])), not flags["pictures"]
    sources = [PictureSource(memory, period, is_stepped=context.clock.relays) for memory in memories]
    senders = enumerate(sources, flags["id"])
    return [RecordedCamera(source, encoder, sender, store, required) for sender, source in senders]
