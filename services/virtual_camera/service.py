"""The virtual camera on the bus and in shared memory."""

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import cv2

from services.base import Context, Flags, Output, Service, period_of
from services.base.pictures import memories, show
from services.scene.camera import CameraPose, mount
from services.scene.lens import camera_of
from services.scene.render import Renderer
from services.scene.scene import Scene, SceneOptions, load_scene
from services.scene.shading import Light
from services.scene.truth import TruthSender, truth_sender
from services.virtual_camera.model import Publish, VirtualCamera
from services.virtual_camera.optics import Optics, Sensor, load_overlays


class VirtualCameraService(Service):
    """Draws at its rate from the frames of one sender."""

    def __init__(self, camera: VirtualCamera, freq: float, frame_id: int, truth_sender: TruthSender | None) -> None:
        self.period = period_of(freq)
        self.inputs = {("opendlv.sim.Frame", stamp): partial(camera.take_body, stamp) for stamp in camera.bodies}
        self.inputs["opendlv.sim.Frame", frame_id] = camera.take_frame
        self._camera, self._truth_sender = camera, truth_sender

    def update(self, now: int) -> Iterable[Output]:
        pose = self._camera.update(now)
        return self._truth_sender.outputs(pose) if self._truth_sender and pose else ()


def open_scene(flags: Flags) -> tuple[Renderer, Optics]:
    """The scene and the camera of the flags; raises InputError and ValueError."""
    cv2.setNumThreads(1)
    scene = _scene(flags)
    optics = _optics(flags, scene)
    return Renderer(scene, optics.wide.width, optics.wide.height, optics.wide.fovy), optics


def mounted_camera(flags: Flags, renderer: Renderer, optics: Optics, publish: Publish) -> VirtualCamera:
    """The camera in its place on the vehicle, which stands where the flags say until it moves."""
    mounted = mount(*(flags[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")))
    return VirtualCamera(renderer, mounted, publish, optics, _start(flags))


def _scene(flags: Flags) -> Scene:
    light = Light.of_flags(flags["light.azimuth"], flags["light.elevation"], flags["light.ambient"])
    numbers = {name: flags[name] for name in ("clutter", "displaced", "seed")}
    options = SceneOptions(light, tuple(flags["lines"]), flags["line-width"], **numbers, own=flags["frame-id"])
    return load_scene(Path(flags["map-path"]), options)


def _optics(flags: Flags, scene: Scene) -> Optics:
    camera, lens = camera_of(flags)
    sensor = Sensor(flags["exposure"], flags["gain"], flags["noise"], flags["seed"])
    overlays = list(load_overlays(scene.overlays, camera.width, camera.height))
    return Optics(camera, lens, sensor, overlays, flags["shutter"])


def _start(flags: Flags) -> CameraPose | None:
    written = [flags[f"start-{name}"] for name in ("x", "y", "yaw")]
    if written == [None] * 3:
        return None
    x, y, yaw = (value or 0.0 for value in written)
    return CameraPose.at(x, y, 0.0, yaw=math.radians(yaw))


def build(context: Context) -> Service:
    """The service from its flags; raises InputError, ValueError and SharedMemoryError."""
    flags = context.flags
    renderer, optics = open_scene(flags)
    publish = partial(show, memories(context, flags["width"], flags["height"]))
    camera = mounted_camera(flags, renderer, optics, publish)
    return VirtualCameraService(camera, flags["freq"], flags["frame-id"], truth_sender(context, renderer, optics.lens))
