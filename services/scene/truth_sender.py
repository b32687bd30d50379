"""Sends the true boxes of a scene's models as messages."""

from collections.abc import Iterable, Iterator

from google.protobuf.message import Message

from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.base import Context, Flags, Output
from services.scene.camera import CameraPose, Pinhole
from services.scene.draw.render import Renderer
from services.scene.lens import Lens
from services.scene.truth import SceneTruth, TrueBox, TruthLimits, classes_of


class TruthSender:
    """Sends true boxes as OpenDLV's detections, under its own sender stamp."""

    def __init__(
        self, truth: SceneTruth, classes: Iterable[str], camera: Pinhole, messages: MessageSet, stamp: int
    ) -> None:
        self._truth, self._camera, self._stamp = truth, camera, stamp
        self._types = {name: number for number, name in enumerate(dict.fromkeys(classes), start=1)}
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
        wide, high = self._camera.width, self._camera.height
        fractions = {"x": box.left / wide, "y": box.top / high, "width": box.width / wide, "height": box.height / high}
        return (
            kind(detectionId=box.number, type=self._types[box.name]),
            name(detectionId=box.number, property=box.name),
            place(detectionId=box.number, **fractions),
        )


def open_truth(flags: Flags, renderer: Renderer, lens: Lens | None) -> tuple[SceneTruth, dict[str, str]]:
    """What knows the true boxes, and the classes by model; raises ValueError for a model that the map lacks."""
    classes = classes_of(flags["truth-classes"], renderer.bodies.names)
    limits = TruthLimits(flags["truth-min-visible"], flags["truth-min-height"])
    return SceneTruth(renderer, classes, limits, lens), classes


def truth_sender(context: Context, renderer: Renderer, lens: Lens | None) -> TruthSender | None:
    """The sender of the flags, None where they name no stamp."""
    stamp = context.flags["truth-sender"]
    if stamp is None:
        return None
    truth, classes = open_truth(context.flags, renderer, lens)
    camera = lens.camera if lens else renderer.camera
    return TruthSender(truth, classes.values(), camera, context.messages, stamp)
