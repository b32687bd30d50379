"""Frames with the requests that answered them, for programs that learn to steer from frames (images, one table).

A frame is answered by the first GroundSteeringRequest of its sample time or later, at most ``PATIENCE`` later: an
application of DoDo's tests copies the frame's sample time, a person at the wheel reacts after it. Recordings of a data
set are for training or for validation.
"""

import csv
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.frames import decoded, write_picture

TABLE = "steering.csv"
PICTURES = "images"
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


@dataclass
class SteeringExport:
    """Writes into ``folder``, as ``png`` or ``jpg``; ``progress`` and ``problem`` as of the COCO export."""

    folder: Path
    picture_type: str
    progress: Callable[[int], None]
    problem: Callable[[str], None]
    rows: list[tuple[Any, ...]] = field(default_factory=list)
    lost: int = 0
    unanswered: int = 0

    def add(self, recording: Recording, messages: MessageSet, rows: Numbers, images: Numbers, name: str = "") -> None:
        """Writes the answered frames of a recording; raises OSError."""
        (self.folder / PICTURES).mkdir(parents=True, exist_ok=True)
        steering = _requests(recording, messages, rows, _STEERING, "groundSteering")
        pedal = _requests(recording, messages, rows, _PEDAL, "position")
        for done, (packet, frame) in enumerate(decoded(recording, images, self.problem), 1):
            angle = steering.answer(packet.sample_time)
            if frame is None:
                self.lost += 1
            elif angle is None:
                self.unanswered += 1
            else:
                parts = [*([name] if name else []), packet.sender_stamp, packet.sample_time]
                path = f"{PICTURES}/{'-'.join(map(str, parts))}.{self.picture_type}"
                write_picture(self.folder / path, frame)
                pressed = pedal.answer(packet.sample_time)
                self.rows.append((path, recording.path, packet.sample_time, angle, "" if pressed is None else pressed))
            self.progress(done)

    def finish(self) -> None:
        """Writes the table; raises OSError."""
        with (self.folder / TABLE).open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(self.rows)


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
