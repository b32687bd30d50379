"""True bounding boxes of the models that a picture shows, found and sent as messages."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from google.protobuf.message import Message

from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags, Output
from services.scene.camera import NEAR, Array, CameraPose, Pinhole, View, clip
from services.scene.lens import Lens
from services.scene.raster import Image, fill_fixed
from services.scene.render import Renderer
from services.scene.shading import Piece

_ONE = 256
"""Fixed point numbers of a pixel."""


@dataclass(frozen=True)
class TrueBox:
    """The visible box of one model: ``left``, ``top``, ``width``, ``height`` in pixels from the upper left corner.

    ``number`` counts the map's models, all copies of the first before those of the second; ``visible`` is the share of
    the model's pixels that nothing hides and the picture holds.
    """

    number: int
    name: str
    left: float
    top: float
    width: float
    height: float
    visible: float


def classes_of(written: Iterable[str], models: Iterable[str]) -> dict[str, str]:
    """Classes by model, of words such as ``cone_yellow=yellow``; each model's own name if nothing is written.

    ValueError names a model that the map does not have.
    """
    known = list(dict.fromkeys(name for name in models if name))
    pairs = [word.partition("=") for word in written]
    for name, _, _ in pairs:
        if name not in known:
            raise ValueError(f"there is no model '{name}' in the map, which has {', '.join(known) or 'none'}")
    return {name: kind or name for name, _, kind in pairs} or {name: name for name in known}


class SceneTruth:
    """Finds the boxes of named models in pictures of a renderer, as a lens in front of it shows them."""

    def __init__(
        self, renderer: Renderer, classes: Mapping[str, str], visible: float, height: float, lens: Lens | None = None
    ) -> None:
        """A box has at least this visible share, and this height in pixels."""
        self.renderer, self.classes, self._visible, self._height, self._lens = renderer, classes, visible, height, lens
        self.camera = lens.camera if lens else renderer.camera

    def boxes(self, pose: CameraPose) -> list[TrueBox]:
        """All boxes that keep within the limits, by number; ``pose`` is the camera's in the world."""
        labels, drawn = self.renderer.labels(pose)
        seen = np.bincount(labels[labels >= 0], minlength=len(self.renderer.bodies.names))
        view = self.renderer.camera.view(pose)
        mask = np.zeros(labels.shape, np.uint8)
        names = self.renderer.bodies.names
        found = [
            self._box(view, body, self.classes[names[body]], drawn[body], int(seen[body]), mask)
            for body in sorted(drawn)
            if seen[body] and names[body] in self.classes
        ]
        return [box for box in found if box is not None]

    def _box(self, view: View, body: int, name: str, pieces: list[Piece], seen: int, mask: Image) -> TrueBox | None:
        corners, inside = _cut(self._corners(view, body), view.camera)
        if self._lens:
            corners, share = _cut(self._lens.shown(corners - 0.5) + 0.5, self._lens.camera)
            inside *= share
        (left, top), (wide, high) = corners.min(axis=0).tolist(), np.ptp(corners, axis=0).tolist()
        if high < self._height or wide <= 0.0:
            return None
        visible = min(seen / max(_alone(pieces, mask), 1) * inside, 1.0)
        if visible < self._visible:
            return None
        return TrueBox(body, name, left, top, wide, high, visible)

    def _corners(self, view: View, body: int) -> Array:
        """Where (n, 2) the renderer's picture has what of a body lies before the camera, in pixels from its corner."""
        vertices, faces = self.renderer.bodies.outline(body)
        points = view.to_camera(vertices)
        if float(points[:, 2].min()) <= NEAR:
            parts = [clip(points[face], np.array([0.0, 0.0, 1.0]), -NEAR) for face in faces]
            points = np.concatenate(parts)
        return self.renderer.camera.project(points) + 0.5


def _cut(points: Array, camera: Pinhole) -> tuple[Array, float]:
    """Points (n, 2) in pixels moved into a camera's picture, and the share of the rectangle around them inside it."""
    whole = float(np.prod(np.ptp(points, axis=0)))
    kept = np.clip(points, 0.0, [camera.width, camera.height])
    return kept, float(np.prod(np.ptp(kept, axis=0))) / whole if whole > 0.0 else 0.0


def _alone(pieces: list[Piece], mask: Image) -> int:
    """How many pixels the pieces of a body cover when nothing is before them; ``mask`` is empty before and after."""
    points = np.concatenate([points.reshape(-1, 2) for points, _ in pieces]) // _ONE
    size = np.array(mask.shape[::-1])
    (left, top), (right, bottom) = (np.clip(edge, 0, size).tolist() for edge in (points.min(0) - 1, points.max(0) + 3))
    for corners, _ in pieces:
        fill_fixed(mask, corners, (1,))
    window = mask[top:bottom, left:right]
    covered = cv2.countNonZero(window) if window.size else 0
    window.fill(0)
    return covered


class TruthSender:
    """Sends true boxes as OpenDLV's detections, under its own sender stamp."""

    def __init__(self, truth: SceneTruth, messages: MessageSet, stamp: int) -> None:
        self._truth, self._stamp = truth, stamp
        self.renderer = truth.renderer
        self._types = {name: number for number, name in enumerate(dict.fromkeys(truth.classes.values()), start=1)}
        names = ("DetectionType", "DetectionProperty", "DetectionBoundingBox")
        self._kinds = [messages.type(f"opendlv.logic.perception.{name}") for name in names]

    def outputs(self, pose: CameraPose, sample_time: int | None = None) -> Iterator[Output]:
        """Three messages a box, the same detectionId for the same model in every picture.

        Their sample time is that of the picture, in us; the time at which they are sent when it is None.
        """
        for box in self._truth.boxes(pose):
            for message in self._messages(box):
                yield Output(message, self._stamp, sample_time)

    def _messages(self, box: TrueBox) -> tuple[Message, ...]:
        kind, name, place = self._kinds
        wide, high = self._truth.camera.width, self._truth.camera.height
        fractions = {"x": box.left / wide, "y": box.top / high, "width": box.width / wide, "height": box.height / high}
        return (
            kind(detectionId=box.number, type=self._types[box.name]),
            name(detectionId=box.number, property=box.name),
            place(detectionId=box.number, **fractions),
        )


def open_truth(flags: Flags, renderer: Renderer, lens: Lens | None) -> SceneTruth:
    """What knows the true boxes; raises ValueError for a model that the map lacks."""
    classes = classes_of(flags["truth-classes"], renderer.bodies.names)
    return SceneTruth(renderer, classes, flags["truth-min-visible"], flags["truth-min-height"], lens)


def truth_sender(context: Context, renderer: Renderer, lens: Lens | None) -> TruthSender | None:
    """The sender of the flags, None if they name no stamp."""
    stamp = context.flags["truth-sender"]
    if stamp is None:
        return None
    return TruthSender(open_truth(context.flags, renderer, lens), context.messages, stamp)
