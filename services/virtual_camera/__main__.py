"""The virtual camera as a program: pictures of a map into shared memory."""

import math
import sys
from pathlib import Path

import cv2

from dodo_dsl.opendlv.memory import SharedMemory
from services.base import Context, Service, run
from services.base.service import period_of
from services.virtual_camera.model import Publish, VirtualCamera, mount
from services.virtual_camera.raster import Image
from services.virtual_camera.render import Renderer
from services.virtual_camera.scene import load_scene


class CameraService(Service):
    """Draws at its rate from the frames of one sender."""

    def __init__(self, camera: VirtualCamera, freq: float, frame_id: int) -> None:
        self.period = period_of(freq)
        self.inputs = {("opendlv.sim.Frame", frame_id): camera.take_frame}
        self._camera = camera

    def update(self, now: int) -> tuple[()]:
        self._camera.update(now)
        return ()


def publisher(argb: SharedMemory, i420: SharedMemory) -> Publish:
    """Writes both pictures as OpenDLV's readers expect: copied and stamped under the lock, then told."""

    def publish(argb_picture: Image, i420_picture: Image, sample_time: int) -> None:
        for memory, picture in ((argb, argb_picture), (i420, i420_picture)):
            with memory.lock():
                memory.buffer[: picture.nbytes] = picture.data.cast("B")
                memory.stamp(sample_time)
            memory.notify_all()

    return publish


def build(context: Context) -> Service:
    flags = context.flags
    width, height = flags["width"], flags["height"]
    cv2.setNumThreads(1)
    renderer = Renderer(load_scene(Path(flags["map-path"])), width, height, math.radians(flags["fovy"]))
    mounted = mount(*(flags[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")))
    argb = context.memory(flags["name.argb"], width * height * 4)
    i420 = context.memory(flags["name.i420"], width * height * 3 // 2)
    camera = VirtualCamera(renderer, mounted, publisher(argb, i420))
    return CameraService(camera, flags["freq"], flags["frame-id"])


if __name__ == "__main__":
    sys.exit(run(Path(__file__).parent, build))
