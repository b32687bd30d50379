"""Frames with the requests that answered them, for programs that learn to steer from frames (images, one table).

A frame is answered by the first GroundSteeringRequest of its sample time or later, at most ``PATIENCE`` later: an
application of DoDo's tests copies the frame's sample time, a person at the wheel reacts after it. Recordings of a data
set are for training or for validation.
"""

import csv
import random
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.frames import PictureSet, write_picture

TABLE = "steering.csv"
COLUMNS = ("picture", "recording", "sample_time_us", "ground_steering_rad", "pedal")
PATIENCE = 200_000
"""us, two frames at 10 Hz"""
_STEERING, _PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"


@dataclass(frozen=True)
class RequestedValues:
    """Values of a request by the time (us) that they are of."""

    times: Numbers
    values: Sequence[float]

    def answer(self, time: int) -> float | None:
        """The first one for a frame."""
        at = int(np.searchsorted(self.times, time))
        return self.values[at] if at < len(self.times) and self.times[at] - time <= PATIENCE else None


Answers = Callable[[int], tuple[float, float | None] | None]
"""The steering and the pedal for a frame of a time, None for a frame without steering."""


def answers(recording: Recording, messages: MessageSet, rows: Numbers) -> Answers:
    """What the messages of ``rows`` answer."""
    steering = _requests(recording, messages, rows, _STEERING, "groundSteering")
    pedal = _requests(recording, messages, rows, _PEDAL, "position")

    def answer(time: int) -> tuple[float, float | None] | None:
        angle = steering.answer(time)
        return None if angle is None else (angle, pedal.answer(time))

    return answer


@dataclass
class SteeringExport(PictureSet):
    """Frames and a table."""

    images: list[tuple[Any, ...]] = field(default_factory=list)
    unanswered: int = 0
    classes: Collection[str] = ()
    missing = "has a GroundSteeringRequest of its sample time or soon after it"

    def __str__(self) -> str:
        return f"{len(self.images)} frames with steering"

    def add(
        self, recording: Recording, images: Numbers, answer: Answers, name: str, progress: Callable[[int], None]
    ) -> None:
        """Writes the answered frames of a recording; raises OSError."""
        for packet, frame, path in self.frames(recording, images, name, progress):
            found = answer(packet.sample_time)
            if found is None:
                self.unanswered += 1
                continue
            write_picture(self.folder / path, frame)
            angle, pedal = found
            self.images.append((path, recording.path, packet.sample_time, angle, "" if pedal is None else pedal))

    def notes(self) -> Iterator[str]:
        yield from super().notes()
        if self.unanswered:
            yield f"left out {self.unanswered} frames without a GroundSteeringRequest within 0.2 s"

    def finish(self, _: Collection[str]) -> None:
        """Writes the table; raises OSError."""
        with (self.folder / TABLE).open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(self.images)


def _requests(recording: Recording, messages: MessageSet, rows: Numbers, name: str, of: str) -> RequestedValues:
    if name not in messages.names():
        return RequestedValues(np.zeros(0, np.int64), [])
    found: list[tuple[int, float]] = []
    chosen = rows[recording.index["data_type"][rows] == messages.id(name)]
    for time, envelope in zip(recording.index["time"][chosen].tolist(), recording.envelopes(chosen), strict=True):
        try:
            value = float(getattr(messages.decode(envelope.data_type, envelope.payload), of))
        except (MessageError, AttributeError):
            continue
        if np.isfinite(value):
            found.append((time, value))
    found.sort(key=lambda one: one[0])
    return RequestedValues(np.array([time for time, _ in found], np.int64), [value for _, value in found])


TRAIN, VALIDATION = "train", "validation"


class SplitError(ValueError):
    """Recordings that cannot be split; one sentence."""

    usage = True


def split_recordings(files: Sequence[Path], share: float, seed: int) -> dict[str, list[Path]]:
    """The files by part, in their order; all in one part with the name "" if ``share`` is 0.

    Whole recordings are chosen, as frames of one drive are alike; the same ones for the same number of files and seed.
    Raises SplitError for fewer than two.
    """
    if not share:
        return {"": list(files)}
    if len(files) < 2:
        raise SplitError("--validation needs two recordings or more, as frames of one drive are alike")
    count = min(max(round(share * len(files)), 1), len(files) - 1)
    chosen = set(random.Random(seed).sample(range(len(files)), count))  # noqa: S311  (repeatable, not secret)
    parts = {TRAIN: [n for n in range(len(files)) if n not in chosen], VALIDATION: sorted(chosen)}
    return {name: [files[number] for number in numbers] for name, numbers in parts.items()}
