"""What a test's evaluators recorded of what they judged, as the page draws it: it lies beside their logs.

An evaluator of someone's own records as the shipped ones do, and nothing here knows which one it was.
"""

import base64
import contextlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from dodo_dsl.log_times import JUDGED_SUFFIX
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import checks
from dodo_dsl.report.trajectory import Way
from dodo_dsl.report.viewer.encoded import packed, shown
from dodo_dsl.report.viewer.recorded import MICROSECONDS, Values
from dodo_dsl.report.viewer.units import title_of, unit_of

_BOX = {"hit": 6, "false": 5, "missed": 5}
"""Kinds of boxes, and how many texts and numbers each has after its kind."""
_ROLES = ("wall", "gate", "goal")
_MOST_BYTES = 16 << 20
_Part = tuple[Values, Values, bytes]
_Parts = list[_Part]


class Line(msgspec.Struct):
    """A line of a record: what it is, the key says that it has of ``series`` to ``parameters``."""

    series: str | None = None
    samples: str | None = None
    target: str | None = None
    message: str | None = None
    frames: list[tuple[int, bool, list[list[str | float]]]] | None = None
    way: Way | None = None
    parameters: dict[str, tuple[str, ...]] = {}
    unit: str = ""
    low: float | None = None
    high: float | None = None
    distance: float | None = None
    band: float | None = None
    exclusive: bool = False
    zero: float = 0.0
    times: bytes = b""
    values: bytes = b""
    marks: bytes = b""
    sender: int | None = None
    cut: int = 0

    def about(self, evaluator: str) -> dict[str, Any]:
        """A plot without its samples."""
        signal = shown(self.series, 200)
        name, unit = title_of(signal), shown(self.unit, 40) or unit_of(signal)
        notes = [f"band ±{self.band:.4g}"] if self.band is not None else []
        notes += [checks.bound("min", self.low, unit, self.exclusive)] if self.low is not None else []
        notes += [checks.bound("max", self.high, unit, self.exclusive)] if self.high is not None else []
        notes += [f"distance {checks.bound('max', self.distance, unit)}"] if self.distance is not None else []
        limits = {name: getattr(self, name) for name in ("low", "high", "distance", "band")}
        return {
            "evaluator": shown(evaluator, 80),
            "name": name,
            "unit": unit,
            **limits,
            "note": ", ".join(notes),
        }

    def part(self) -> _Part:
        """Times in us of the test, values and marks."""
        times, values = (np.frombuffer(data, "<f4").astype(np.float64) for data in (self.times, self.values))
        if not len(times) == len(values) == len(self.marks):
            raise ValueError("parts of different lengths")
        return self.zero + times * MICROSECONDS, values, self.marks


@dataclass
class JudgedRecord:
    """All records of a test; ``silent`` are its evaluators that left none.

    ``parameters`` set the limit of a check, by the service's name and the check's.
    """

    way: Way | None = None
    parameters: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)
    silent: list[str] = field(default_factory=list)
    messages: list[dict[str, Any]] = field(default_factory=list)
    cut: int = 0
    _series: dict[tuple[str, str], tuple[dict[str, Any], _Parts, _Parts]] = field(default_factory=dict)
    _frames: dict[int, dict[str, Any]] = field(default_factory=dict)

    def series(self, begin: int) -> list[dict[str, Any]]:
        """One plot each; ``begin`` of the test in us, from which on its times count."""
        return [
            {**about, **_columns(samples, begin), "target": _columns(target, begin)}
            for about, samples, target in self._series.values()
            if samples or target
        ]

    def frames(self, begin: int) -> list[dict[str, Any]]:
        """The boxes of each frame by what became of them, in the order of the frames' times."""
        return [{"time": (time - begin) / MICROSECONDS, **self._frames[time]} for time in sorted(self._frames)]

    def why(self) -> str:
        """Why something may be missing, in a sentence; else empty."""
        if self.silent:
            names = " and ".join(f"'{shown(name, 80)}'" for name in self.silent)
            return f"{names} recorded no time series, so no limits and targets are plotted."
        return f"Only the first {self.cut:,} boxes are drawn." if self.cut else ""

    def take(self, service: str, line: Line) -> None:
        """A line of a record; raises KeyError and ValueError for one that does not fit the lines before."""
        if line.series is not None:
            self._series[service, line.series] = (line.about(service), [], [])
        elif line.samples is not None:
            self._series[service, line.samples][1].append(line.part())
        elif line.target is not None:
            self._series[service, line.target][2].append(line.part())
        elif line.message is not None:
            self.messages.append({"message": shown(line.message, 100), "sender": line.sender})
        elif line.way and not self.way:
            roles = {name: role for name, role in line.way.roles.items() if role in _ROLES}
            self.way = replace(line.way, roles=roles)
        self.parameters |= {service: line.parameters} if line.parameters else {}
        self.cut = self.cut or line.cut
        for time, is_known, boxes in line.frames or ():
            frame = self._frames.setdefault(time, {"isKnown": is_known, **{kind: list[Any]() for kind in _BOX}})
            for kind, *box in boxes:
                if isinstance(kind, str) and len(box) == _BOX.get(kind) and isinstance(box[0], str):
                    frame[kind].append([shown(box[0], 60), *map(float, box[1:])])


def read(plan: Plan, logs: Path) -> JudgedRecord:
    """The records of a test's evaluators in the folder of its logs; what cannot be read is left out."""
    found = JudgedRecord()
    for service in plan.services:
        path = logs / f"{service.layer}.{service.name}{JUDGED_SUFFIX}"
        texts = []
        if service.judge:
            with contextlib.suppress(OSError):
                texts = regular_file.content(path, _MOST_BYTES).splitlines()
            found.silent += [] if texts else [service.name]
        for text in texts:
            with contextlib.suppress(ValueError, KeyError, RecursionError):
                found.take(service.name, msgspec.json.decode(text, type=Line))
    return found


def _columns(parts: _Parts, begin: int) -> dict[str, Any]:
    times = np.concatenate([np.empty(0), *(part[0] for part in parts)])
    values = np.concatenate([np.empty(0), *(part[1] for part in parts)])
    marks = np.frombuffer(b"".join(part[2] for part in parts), np.uint8)
    order = np.argsort(times, kind="stable")
    return {
        "times": packed((times[order] - begin) / MICROSECONDS),
        "values": packed(values[order]),
        "marks": base64.b64encode(marks[order].tobytes()).decode(),
    }
