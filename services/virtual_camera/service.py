"""The virtual camera on the bus and in shared memory."""

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import cv2

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base import Context, Flags, Output, Service, period_of
from services.scene.camera import CameraPose, Pinhole, mount
from services.scene.lens import Alignment, Distortion
from services.scene.raster import Image
from services.scene.render import Renderer
from services.scene.scene import Scene, SceneOptions, load_scene
from services.scene.shading import Light
from services.scene.truth import TruthSender, truth_sender
from services.virtual_camera.model import Publish, VirtualCamera
from services.virtual_camera.optics import Optics, Sensor, load_overlays

Memories = list[tuple[SharedMemory, str]]
"""Shared memory and what it holds: a format of ``pixels``."""


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


def publisher(memories: Memories) -> Publish:
    """Writes all pictures as OpenDLV's readers expect: copied and stamped under the lock, then announced."""

    def publish(argb: Image, i420: Image, sample_time: int) -> None:
        pictures = pixels.with_copies(argb, i420, (kind for _, kind in memories))
        for memory, kind in memories:
            with memory.lock():
                memory.buffer[: pictures[kind].nbytes] = pictures[kind].data.cast("B")
                memory.stamp(sample_time)
            memory.notify_all()

    return publish


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
    camera = Pinhole(flags["width"], flags["height"], math.radians(flags["fovy"]))
    distortion = Distortion(*(flags[f"distortion.{name}"] for name in ("k1", "k2", "p1", "p2")))
    sensor = Sensor(flags["exposure"], flags["gain"], flags["noise"], flags["seed"])
    overlays = list(load_overlays(scene.overlays, camera.width, camera.height))
    alignment = Alignment(*(flags[name] for name in ("focal-x", "centre-x", "centre-y")))
    return Optics(camera, distortion, sensor, overlays, flags["shutter"], alignment)


def _start(flags: Flags) -> CameraPose | None:
    written = [flags[f"start-{name}"] for name in ("x", "y", "yaw")]
    if written == [None] * 3:
        return None
    x, y, yaw = (value or 0.0 for value in written)
    return CameraPose.at(x, y, 0.0, yaw=math.radians(yaw))


def _memories(context: Context) -> Memories:
    size = context.flags["width"] * context.flags["height"]
    names = {kind: context.flags[f"name.{kind}"] for kind in pixels.FORMATS}
    return [(context.memory(name, size * pixels.HALF_BYTES[kind] // 2), kind) for kind, name in names.items() if name]


def build(context: Context) -> Service:
    """The service from its flags; raises InputError, ValueError and SharedMemoryError."""
    flags = context.flags
    renderer, optics = open_scene(flags)
    publish = publisher(_memories(context))
    camera = mounted_camera(flags, renderer, optics, publish)
    return VirtualCameraService(camera, flags["freq"], flags["frame-id"], truth_sender(context, renderer, optics.lens))
