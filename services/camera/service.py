"""The camera as a service: pictures into shared memory at a fixed rate, and its state for observers of the bus."""

from collections.abc import Iterable
from pathlib import Path

from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags, Output, Service, period_of
from services.base.pictures import Memories, memories, show
from services.base.process import interruptible
from services.camera.picture import CameraError, SharedPicture
from services.camera.sources import FIRST, Camera, FileCamera, Grabber, RpiCamera, V4l2Camera, longest_silence

STATES = ("the camera gives pictures", "the camera gives no picture")
"""Descriptions by code."""
SHORTEST = 1_000_000
"""us without a picture that never count as a loss."""


class CameraTelemetry:
    """A SystemStatusMessage at first and whenever the state changes; none without a sender stamp.

    ``patience`` in us: for how long frames may be missing, if that is more than 1 s.
    """

    def __init__(self, messages: MessageSet, sender_stamp: int | None, patience: int) -> None:
        self._type = messages.type("opendlv.system.SystemStatusMessage")
        self._stamp, self._patience = sender_stamp, max(SHORTEST, patience)
        self._seen: int | None = None
        self._code: int | None = None

    def update(self, has_picture: bool, now: int) -> tuple[Output, ...]:
        """Messages at an instant (us) at which there was a picture or not."""
        if has_picture or self._seen is None:
            self._seen = now
        code = int(now - self._seen > self._patience)
        if self._stamp is None or code == self._code:
            return ()
        self._code = code
        return (Output(self._type(code=code, description=STATES[code]), self._stamp),)


EMULATED = "--source=emulated is the camera of 'rig: emulated', which virtual-camera replaces"


class RigCameraService(Service):
    """Shares the newest picture at each instant of its rate, and none twice; ``telemetry`` reports its state."""

    def __init__(
        self,
        camera: Grabber | FileCamera,
        memories: Memories,
        freq: float,
        telemetry: CameraTelemetry,
    ) -> None:
        self.period = period_of(freq)
        self._camera, self._memories, self._telemetry = camera, memories, telemetry
        self.shared = 0
        """How many pictures were shared."""

    def update(self, now: int) -> Iterable[Output]:
        picture: SharedPicture | None = (
            self._camera.take() if isinstance(self._camera, Grabber) else self._camera.read()
        )
        if picture is not None:
            time = now if picture.time is None else picture.time
            show(self._memories, picture.argb, picture.i420, time)
            self.shared += 1
        return self._telemetry.update(picture is not None, now)


def open_camera(flags: Flags) -> Camera:
    """The camera that the flags name; raises ValueError or OSError."""
    source, width, height = flags["source"], flags["width"], flags["height"]
    if source == "emulated":
        raise ValueError(EMULATED)
    if source == "file" and not flags["file"]:
        raise ValueError("--file is missing: the picture, video or recording for --source=file")
    path = Path(flags["file"] if source == "file" else source)
    if source == "file" or (not source.startswith("/dev/") and path.is_file()):
        return FileCamera(path, width, height)
    if flags["exposure"] * flags["freq"] > 1 + 1e-9:
        fits = f"the {1 / flags['freq']:g} s between two pictures"
        raise ValueError(f"--exposure={flags['exposure']:g} does not fit into {fits}")
    if source == "rpicam":
        return RpiCamera(width, height, flags["freq"], flags["exposure"])
    if source.startswith("/dev/"):
        return V4l2Camera(path, width, height, flags["freq"], flags["exposure"])
    raise ValueError(
        f"--source={source} is not a camera, expected a device such as /dev/video0, rpicam, file or emulated"
    )


def build(context: Context) -> Service:
    """The service from its flags: it is ready when the first picture has come."""
    flags = context.flags
    freq, shared = flags["freq"], memories(context, flags["width"], flags["height"])
    telemetry = CameraTelemetry(
        context.messages, flags["status-id"], 2 * max(period_of(freq), round(flags["exposure"] * 1e6))
    )
    camera = open_camera(flags)
    for note in getattr(camera, "notes", ()):
        context.log.warning("%s", note)
    if isinstance(camera, FileCamera):
        context.resources.callback(camera.close)
        return RigCameraService(camera, shared, freq, telemetry)
    silence = longest_silence(freq, flags["exposure"])
    grabber, first = Grabber(camera, flags["source"], silence), max(FIRST, silence)
    context.resources.callback(grabber.close)
    with interruptible():
        if not grabber.wait(first):
            raise CameraError(f"the camera {flags['source']} gave no picture for {first:g} s")
    return RigCameraService(grabber, shared, freq, telemetry)
