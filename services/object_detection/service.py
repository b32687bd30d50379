"""The evaluator of a perception on the bus."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.assets.truth_file import no_box
from services.base import Context, Flags, Handler
from services.object_detection.boxes import Box, FrameKey, Truth, TypeNumber, Value, load_truth
from services.object_detection.model import DetectionEvaluator

LOGIC = "opendlv.logic.perception.Detection"
ANNOUNCEMENT = "opendlv.proxy.ImageReadingShm"

Take = Callable[[FrameKey, int, Value], None]

VALUES: dict[str, Callable[[Any], Value]] = {
    "BoundingBox": lambda message: Box(message.x, message.y, message.width, message.height),
    "Property": lambda message: str(message.property),
    "Type": lambda message: TypeNumber(message.type),
}


class ObjectDetection(DetectionEvaluator):
    """Takes detections, truth and announcements of frames, each under its sender stamp."""

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        flags = context.flags
        truth = _truth(flags)
        if flags["from"] + flags["max-delay"] >= flags["max-time"]:
            raise ValueError("no frame would be judged: --max-time must be longer than --from and --max-delay together")
        super().__init__(truth, flags)
        self._sender = flags["sender"]
        self.inputs: dict[tuple[str, int | None], Handler] = _handlers(flags["sender"], self.detect)
        if truth is None:
            self.inputs |= _handlers(flags["truth-sender"], self.reveal)
        if flags["frame-sender"] is not None:
            self.inputs[ANNOUNCEMENT, flags["frame-sender"]] = self._take_announcement

    def _take_announcement(self, message: Any, sample_time: int) -> None:
        by_application = (ANNOUNCEMENT, self._sender) in self.inputs
        self.announce(FrameKey(sample_time, message.sampleId), by_application)


build = ObjectDetection


def _handlers(sender: int, take: Take) -> dict[tuple[str, int | None], Handler]:
    return {(LOGIC + name, sender): _handler(value, take) for name, value in VALUES.items()}


def _handler(value: Callable[[Any], Value], take: Take) -> Handler:
    return lambda message, time: take(FrameKey(time, message.sampleId), message.detectionId, value(message))


def _truth(flags: Flags) -> Truth | None:
    """The truth from its file, None for one that comes live."""
    path, sender, classes = flags["truth"], flags["truth-sender"], flags["classes"]
    if path is not None and sender is not None:
        raise ValueError("give the true boxes either as a file, --truth, or as messages, --truth-sender")
    if sender == flags["sender"]:
        raise ValueError(f"--truth-sender={sender} is the --sender of the detections")
    if path is None:
        return None
    truth = load_truth(Path(path), flags["truth-frames"])
    for name in classes:
        if name not in truth.labels():
            raise ValueError(f"--classes: {path} has {no_box(name, truth.labels())}")
    return truth
