"""What an evaluator judged over time, for the report to draw, as lines of JSON below 64 KiB; it decides nothing."""

import base64
import json
import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

MOST_SAMPLES = 20_000
"""Of one series: of more, the lowest and the highest of neighbours stay, and those that failed before others."""
MOST_SERIES = 50
MOST_BOXES = 60_000
"""Of all frames together: frames after these are left out."""
FINE, WARNED, FAILED = 0, 1, 2

_PART, _BOXES_OF_A_LINE, _MOST_TEXT, _FARTHEST = 2000, 60, 60, 100.0
_DIGITS = 4

LabelledArea = tuple[str, float, float, float, float]
"""Class, left, top, width and height; fractions of the picture."""
ScoredArea = tuple[str, float, float, float, float, float]
"""The same of a box that was found, with its overlap with the true one."""


@dataclass
class Series:
    """One quantity over time, in ``unit``; its name is the plot's title. Limits are None if there are none.

    ``low`` and ``high`` are limits of the value, which fails at one only where they are ``exclusive``. ``distance`` is
    the largest one from the target, ``band`` a smaller one beyond which samples only stand out.
    """

    name: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    exclusive: bool = False
    distance: float | None = None
    band: float | None = None
    _samples: list[tuple[int, float, int]] = field(default_factory=list, repr=False)
    """Times, values and marks."""
    _target: "Series | None" = field(default=None, repr=False)

    def add(self, time: int, value: float, target: float | None = None, mark: int | None = None) -> None:
        """A sample at a time in us of the test, with its target; it failed beyond a limit, or as ``mark`` says."""
        if len(self._samples) >= 2 * MOST_SAMPLES:
            self._thin()
        self._samples.append((time, value, self._mark(value, target) if mark is None else mark))
        if target is not None:
            self.aim(time, target)

    def aim(self, time: int, target: float) -> None:
        """A point of the target, which is drawn by straight lines, where it is known at other times than samples."""
        self._target = self._target or Series(self.name)
        self._target.add(time, target)

    def clear(self) -> None:
        self._samples, self._target = [], None

    def lines(self) -> Iterator[dict[str, Any]]:
        limits = {name: finite(getattr(self, name)) for name in ("low", "high", "distance", "band")}
        yield {"series": self.name, "unit": self.unit, "exclusive": self.exclusive, **limits}
        yield from self._parts("samples")
        if self._target:
            yield from self._target._parts("target")

    def _parts(self, key: str) -> Iterator[dict[str, Any]]:
        while len(self._samples) > MOST_SAMPLES:
            self._thin()
        for begin in range(0, len(self._samples), _PART):
            times, values, marks = zip(*self._samples[begin : begin + _PART], strict=True)
            yield {
                key: self.name,
                "zero": times[0],
                "times": _packed(array("f", [(time - times[0]) / 1e6 for time in times])),
                "values": _packed(array("f", values)),
                "marks": _packed(bytes(marks)),
            }

    def _mark(self, value: float, target: float | None) -> int:
        away = 0.0 if target is None else abs(value - target)
        is_beyond = (self.low is not None and value < self.low) or (self.high is not None and value > self.high)
        is_at_limit = self.exclusive and value in (self.low, self.high)
        is_far = self.distance is not None and away > self.distance
        if not math.isfinite(value) or is_beyond or is_at_limit or is_far:
            return FAILED
        return WARNED if self.band is not None and away > self.band else FINE

    def _thin(self) -> None:
        """Of four neighbours the lowest and the highest stay, but one that failed before others."""
        kept = []
        for begin in range(0, len(self._samples), 4):
            four = self._samples[begin : begin + 4]
            low, high, worst = min(four, key=_value), max(four, key=_value), max(four, key=lambda each: each[2])
            low = worst if worst[2] > max(low[2], high[2]) else low
            kept += [each for each in four if each is low or each is high]
        self._samples = kept


def _value(sample: tuple[int, float, int]) -> float:
    return sample[1]


class JudgedBoxes(NamedTuple):
    """What became of a frame's boxes; ``hit`` ones are those found, each with its overlap at the end."""

    hit: Sequence[ScoredArea]
    false: Sequence[LabelledArea]
    missed: Sequence[LabelledArea]
    is_known: bool = True
    """Whether there are true boxes of this frame; else all that was found is among the false ones."""


@dataclass
class Judged:
    """The record of one evaluator, which the base prints at its end."""

    _series: list[Series] = field(default_factory=list)
    _frames: list[tuple[int, JudgedBoxes]] = field(default_factory=list)
    _boxes: int = 0
    _is_cut: bool = False
    _facts: list[dict[str, Any]] = field(default_factory=list)

    def series(self, name: str, unit: str = "", **limits: Any) -> Series:
        """A new series, drawn in the order in which they are made; limits by the names that ``Series`` has."""
        made = Series(name, unit, **limits)
        self._series.append(made)
        return made

    def frame(self, time: int, boxes: JudgedBoxes) -> None:
        """The boxes of the frame that was sampled at a time in us of the test."""
        self._boxes += len(boxes.hit) + len(boxes.false) + len(boxes.missed)
        self._is_cut = self._is_cut or self._boxes > MOST_BOXES
        if not self._is_cut:
            self._frames.append((time, boxes))

    def message(self, name: str, sender_stamp: int | None) -> None:
        """The fields of this message are plotted, too; None for any sender."""
        self._facts.append({"message": name, "sender": sender_stamp})

    def way(self, frame_id: int, length: float, width: float, roles: Mapping[str, str]) -> None:
        """A vehicle of so many m whose frames come under ``frame_id``; ``roles`` of a map's obstacles by their names.

        A role is ``wall``, ``gate`` or ``goal``; gates are crossed in this order.
        """
        self._facts.append({"way": {"frame": frame_id, "length": length, "width": width, "roles": dict(roles)}})

    def clear(self) -> None:
        for each in self._series:
            each.clear()
        self._frames.clear()
        self._boxes, self._is_cut = 0, False

    def lines(self, parameters: Mapping[str, Sequence[str]]) -> Iterator[str]:
        """The record, a line of JSON each; ``parameters`` set the limits of the checks of these names."""
        for each in self._all(parameters):
            yield json.dumps({"dodo": "judged", **each}, allow_nan=False)

    def _all(self, parameters: Mapping[str, Sequence[str]]) -> Iterator[dict[str, Any]]:
        yield from self._facts
        if parameters:
            yield {"parameters": {name: list(names) for name, names in parameters.items()}}
        for series in self._series[:MOST_SERIES]:
            yield from series.lines()
        for time, boxes in self._frames:
            listed = [[kind, *each] for kind in ("hit", "false", "missed") for each in _shown(getattr(boxes, kind))]
            for begin in range(0, max(len(listed), 1), _BOXES_OF_A_LINE):
                yield {"frames": [[time, boxes.is_known, listed[begin : begin + _BOXES_OF_A_LINE]]]}
        if self._is_cut:
            yield {"frames": [], "cut": MOST_BOXES}


def finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _packed(numbers: "array[float] | bytes") -> str:
    return base64.b64encode(bytes(numbers)).decode()


def _shown(boxes: Sequence[tuple[Any, ...]]) -> Iterator[list[Any]]:
    for label, *numbers in boxes:
        if all(abs(number) < _FARTHEST for number in numbers):
            yield [label[:_MOST_TEXT], *(round(float(number), _DIGITS) for number in numbers)]
