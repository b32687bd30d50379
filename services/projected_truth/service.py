"""The projected truth on the bus: boxes for each picture of a camera that somebody else takes."""

import logging
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cv2

from dodo_dsl.opendlv.envelope import MICROSECONDS
from services.base import Context, Flags, Output, Service
from services.base.polled_memory import PolledMemory
from services.projected_truth.path import MeasuredPath
from services.scene.camera import CameraPose, body_pose, mount
from services.scene.lens import Lens, camera_of
from services.scene.render import Renderer
from services.scene.scene import SceneOptions, load_scene
from services.scene.truth import TruthSender, truth_sender

PATIENCE = 250_000
"""us after a picture in which a pose measured later has to come; then the vehicle counts as moving on evenly."""
_MOST = 64
_LOCK_PATIENCE = 0.02  # s

_log = logging.getLogger(__name__)

Followed = Callable[[int], int | None]
"""Takes the time, in us; gives the sample time of a picture that is new."""


class ProjectedTruth(Service):
    """Boxes of each picture as soon as the pose at its time is known; ``projected`` and ``missed`` count pictures."""

    period = 5_000

    def __init__(
        self, sender: TruthSender, mounted: CameraPose, followed: Followed, frame_id: int | None, latency: int = 0
    ) -> None:
        """``mounted`` is the camera on the vehicle, or in the world without ``frame_id``; ``latency`` in us."""
        self._sender, self._mounted, self._followed, self._latency = sender, mounted, followed, latency
        self._path = None if frame_id is None else MeasuredPath()
        self._bodies = {stamp: MeasuredPath() for stamp in sender.renderer.bodies.stamps}
        paths = {**self._bodies, **({frame_id: self._path} if frame_id is not None and self._path else {})}
        self.inputs = {("opendlv.sim.Frame", stamp): partial(self._take, path) for stamp, path in paths.items()}
        self._waiting: deque[int] = deque(maxlen=_MOST)
        self._has_begun = False
        self.projected, self.missed = 0, 0

    def begin(self, now: int) -> None:
        self._has_begun = True

    def _take(self, path: MeasuredPath, frame: Any, sample_time: int) -> None:
        """Where the vehicle or another body is, as measured; ``sample_time`` in us of test time."""
        path.add(sample_time, body_pose(frame))

    def update(self, now: int) -> Iterator[Output]:
        picture = self._followed(now)
        if picture is not None:
            self._waiting.append(picture)
        while self._waiting and self._is_known(self._waiting[0], now):
            picture = self._waiting.popleft()
            pose = self._pose(picture - self._latency)
            if pose is None:
                self.missed += self._has_begun
                continue
            self._place_bodies(picture - self._latency)
            self.projected += 1
            yield from self._sender.outputs(pose, picture)

    def _is_known(self, picture: int, now: int) -> bool:
        paths = [path for path in (self._path, *self._bodies.values()) if path is not None]
        known = all(path.reaches(picture - self._latency) for path in paths if path is self._path or path.has_begun)
        return known or now - picture > PATIENCE

    def _place_bodies(self, time: int) -> None:
        """What moves is where it was at a time; where that is not known it stays."""
        for stamp, path in self._bodies.items():
            pose = path.at(time)
            if pose is not None:
                self._sender.renderer.place(stamp, pose)

    def _pose(self, time: int) -> CameraPose | None:
        if self._path is None:
            return self._mounted
        body = self._path.at(time)
        return body.carrying(self._mounted) if body else None

    def tell(self) -> None:
        _log.info("projected the truth into %d pictures", self.projected)
        if self.missed:
            _log.warning("%d pictures have no truth: no pose was measured near them", self.missed)


def build(context: Context) -> Service:
    """The service from its flags; raises InputError and ValueError."""
    flags = context.flags
    if context.clock.relays:
        raise ValueError("a rig does not wait, so this is for real time; in lockstep virtual-camera has a truth-sender")
    cv2.setNumThreads(1)
    renderer, lens = _open(flags)
    sender = truth_sender(context, renderer, lens)
    assert sender is not None, "--truth-sender is required"
    mounted = mount(*(flags[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")))
    memory = PolledMemory(flags["follow"], _LOCK_PATIENCE)
    context.resources.callback(memory.close)
    latency = round(flags["latency"] * MICROSECONDS)
    service = ProjectedTruth(sender, mounted, partial(_new_picture, memory), flags["frame-id"], latency)
    context.resources.callback(service.tell)
    return service


def _new_picture(memory: PolledMemory, now: int) -> int | None:
    """The sample time of the picture in a memory, in us, if that was not passed on yet."""
    time = memory.poll(now, lambda _, time: None if time == memory.last else time)
    if time is not None:
        memory.pass_over(time)
    return time


def _open(flags: Flags) -> tuple[Renderer, Lens | None]:
    camera, lens = camera_of(flags)
    wide = lens.wide if lens else camera
    scene = load_scene(Path(flags["map-path"]), SceneOptions(own=flags["frame-id"]))
    return Renderer(scene, wide.width, wide.height, wide.fovy), lens
