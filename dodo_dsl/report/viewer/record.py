"""What a test's evaluators recorded of what they judged, as the page draws it: it lies beside their logs.

An evaluator of someone's own records as the shipped ones do, and nothing here knows which one it was.
"""

import base64
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.log_times import JUDGED_SUFFIX
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import comparison
from dodo_dsl.report.trajectory import Way
from dodo_dsl.report.viewer.encoded import packed, shown
from dodo_dsl.report.viewer.recorded import MICROSECONDS, Values

_KINDS = ("hit", "false", "missed")
_ROLES = ("wall", "gate", "goal")
_MOST_BYTES = 16 << 20


@dataclass
class _Series:
    """A plot, and the parts of its samples and its target: times in us of the test, values, marks."""

    about: dict[str, Any]
    samples: list[tuple[Values, Values, bytes]] = field(default_factory=list)
    target: list[tuple[Values, Values, bytes]] = field(default_factory=list)


@dataclass
class JudgedRecord:
    """All records of a test; ``silent`` are its evaluators that left none.

    ``parameters`` set the limit of a check, by the service's name and the check's.
    """

    way: Way | None = None
    parameters: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)
    silent: list[str] = field(default_factory=list)
    messages: list[dict[str, Any]] = field(default_factory=list)
    is_cut: bool = False
    _series: dict[tuple[str, str], _Series] = field(default_factory=dict)
    _frames: dict[int, dict[str, Any]] = field(default_factory=dict)

    def series(self, begin: int) -> list[dict[str, Any]]:
        """One plot each; ``begin`` of the test in us, from which on its times count."""
        return [
            {**each.about, **_columns(each.samples, begin), "target": _columns(each.target, begin)}
            for each in self._series.values()
            if each.samples or each.target
        ]

    def frames(self, begin: int) -> list[dict[str, Any]]:
        """The boxes of each frame by what became of them, in the order of the frames' times."""
        return [{"time": (time - begin) / MICROSECONDS, **self._frames[time]} for time in sorted(self._frames)]

    def why(self) -> str:
        """Why something may be missing, in a sentence; else empty."""
        if self.silent:
            names = " and ".join(f"'{shown(name, 80)}'" for name in self.silent)
            its = "its" if len(self.silent) == 1 else "their"
            return f"{names} recorded nothing of what was judged over time: {its} limits and targets are not drawn."
        return f"Only the first {sum(map(_count, self._frames.values())):,} boxes are drawn." if self.is_cut else ""

    def take(self, service: str, line: Mapping[str, Any]) -> None:
        """A line of a record; raises what a malformed one leads to."""
        if "series" in line:
            self._series[service, line["series"]] = _Series(_about(service, line))
        elif "samples" in line:
            self._series[service, line["samples"]].samples.append(_part(line))
        elif "target" in line:
            self._series[service, line["target"]].target.append(_part(line))
        elif "message" in line:
            sender = line["sender"]
            self.messages.append(
                {"message": shown(line["message"], 100), "sender": None if sender is None else int(sender)}
            )
        elif "frames" in line:
            self._take_frames(line)
        elif "way" in line:
            self.way = self.way or _way(line["way"])
        elif "parameters" in line:
            self.parameters[service] = {check: tuple(map(str, names)) for check, names in line["parameters"].items()}

    def _take_frames(self, line: Mapping[str, Any]) -> None:
        self.is_cut = self.is_cut or "cut" in line
        for time, is_known, boxes in line["frames"]:
            frame = self._frames.setdefault(
                _time(time),
                {"isKnown": bool(is_known), "hit": list[Any](), "false": list[Any](), "missed": list[Any]()},
            )
            for kind, label, *numbers in boxes:
                if kind in _KINDS and len(numbers) == (5 if kind == "hit" else 4):
                    frame[kind].append([shown(label, 60), *map(_finite, numbers)])


def read(plan: Plan, logs: Path) -> JudgedRecord:
    """The records of a test's evaluators in the folder of its logs; what cannot be read is left out."""
    found = JudgedRecord()
    for service in plan.services:
        if service.judge:
            lines = list(_lines(logs / f"{service.layer}.{service.name}{JUDGED_SUFFIX}"))
            found.silent += [] if lines else [service.name]
            for line in lines:
                try:
                    found.take(service.name, line)
                except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
                    continue
    return found


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    try:
        texts = regular_file.text(path, _MOST_BYTES).splitlines()
    except (OSError, ValueError):
        return
    for text in texts:
        try:
            line = json.loads(text)
        except (ValueError, RecursionError):
            continue
        if isinstance(line, dict):
            yield line


def _about(service: str, line: Mapping[str, Any]) -> dict[str, Any]:
    low, high, distance, band = (_number(line.get(key)) for key in ("low", "high", "distance", "band"))
    unit, exclusive = shown(line.get("unit") or "", 40), bool(line.get("exclusive"))
    limits = [
        "" if band is None else f"band ±{band:.4g}",
        "" if low is None else comparison.bound("min", low, unit, exclusive),
        "" if high is None else comparison.bound("max", high, unit, exclusive),
        "" if distance is None else f"distance {comparison.bound('max', distance)}",
    ]
    return {
        "evaluator": shown(service, 80),
        "name": shown(line["series"], 200),
        "unit": unit,
        "low": low,
        "high": high,
        "distance": distance,
        "band": band,
        "note": ", ".join(filter(None, limits)),
    }


def _part(line: Mapping[str, Any]) -> tuple[Values, Values, bytes]:
    times, values = (
        np.frombuffer(base64.b64decode(line[key], validate=True), "<f4").astype(np.float64)
        for key in ("times", "values")
    )
    marks = base64.b64decode(line["marks"], validate=True)
    if not len(times) == len(values) == len(marks):
        raise ValueError("parts of different lengths")
    return float(line["zero"]) + times * MICROSECONDS, values, marks


def _columns(parts: list[tuple[Values, Values, bytes]], begin: int) -> dict[str, Any]:
    times = np.concatenate([np.empty(0), *(part[0] for part in parts)])
    values = np.concatenate([np.empty(0), *(part[1] for part in parts)])
    marks = np.frombuffer(b"".join(part[2] for part in parts), np.uint8)
    order = np.argsort(times, kind="stable")
    return {
        "times": packed((times[order] - begin) / MICROSECONDS),
        "values": packed(values[order]),
        "marks": base64.b64encode(marks[order].tobytes()).decode(),
    }


def _way(raw: Mapping[str, Any]) -> Way:
    roles = {str(name): role for name, role in raw["roles"].items() if role in _ROLES}
    return Way(int(raw["frame"]), _finite(raw["length"]), _finite(raw["width"]), roles)


def _number(value: Any) -> float | None:
    return None if value is None else _finite(value)


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not a finite number")
    return number


def _time(value: Any) -> int:
    """In us, as messages have it."""
    time = int(value)
    if abs(time) >= 1 << 63:
        raise ValueError("no time")
    return time


def _count(frame: Mapping[str, Any]) -> int:
    return sum(len(frame[kind]) for kind in _KINDS)
