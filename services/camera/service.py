"""The camera as a service: pictures into shared memory at a fixed rate."""

from collections.abc import Iterable
from pathlib import Path

from services.base import Context, Flags, Output, Service, period_of
from services.base.pictures import Memories, memories, show
from services.base.process import interruptible
from services.camera.sources import (
    FIRST,
    Camera,
    CameraError,
    FileCamera,
    Grabber,
    RpiCamera,
    V4l2Camera,
    longest_silence,
)

EMULATED = "--source=emulated is the camera of 'rig: emulated', which virtual-camera replaces"


class RigCameraService(Service):
    """Shares the newest picture at each instant of its rate, and none twice."""

    def __init__(self, camera: Grabber | FileCamera, memories: Memories, freq: float) -> None:
        self.period = period_of(freq)
        self._camera, self._memories = camera, memories

    def update(self, now: int) -> Iterable[Output]:
        if picture := self._camera.take():
            show(self._memories, picture.argb, picture.i420, now if picture.time is None else picture.time)
        return ()


def open_camera(flags: Flags) -> FileCamera | Camera:
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
    camera = open_camera(flags)
    if isinstance(camera, FileCamera):
        context.resources.callback(camera.close)
        return RigCameraService(camera, shared, freq)
    silence = longest_silence(freq, flags["exposure"])
    grabber, first = Grabber(camera, flags["source"], silence), max(FIRST, silence)
    context.resources.callback(grabber.close)
    with interruptible():
        if not grabber.wait(first):
            raise CameraError(f"the camera {flags['source']} gave no picture for {first:g} s")
    return RigCameraService(grabber, shared, freq)
