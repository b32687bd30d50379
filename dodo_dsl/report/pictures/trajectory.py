"""The drive in a recording: the vehicle's path over the map's cones and lines."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.plan.model import Plan

_FRAME = "opendlv.sim.Frame"

Point = tuple[float, float]


@dataclass(frozen=True)
class Ground:
    """The map from above: model positions in metres by colour (RGB, 0 to 1), and named lines."""

    models: list[tuple[tuple[float, float, float], list[Point]]] = field(default_factory=list)
    lines: list[tuple[str, list[tuple[float, float, float, float]]]] = field(default_factory=list)


@dataclass(frozen=True)
class DrivenPath:
    """A path in the world frame: x and y in metres, heading in radians, and seconds since its begin."""

    path: list[tuple[float, float, float, float]]
    ground: Ground
    length: float = 0.0
    width: float = 0.0
    goal: str = ""


def read_drive(plan: Plan, folder: Path, recording: Path) -> DrivenPath | None:
    """The drive of a test, or None when its recording holds no Frame."""
    path = list(_path(recording)) if recording.is_file() else []
    if not path:
        return None
    flags = {f.name: f.value for s in plan.services for f in s.flags if s.judge or f.name == "map-path"}
    ground = read_ground(folder / FILES / flags["map-path"]) if "map-path" in flags else Ground()
    length, width = (float(flags.get(name, 0.0)) for name in ("length", "width"))
    return DrivenPath(path, ground, length, width, flags.get("goal", ""))


def _path(path: Path) -> Iterator[tuple[float, float, float, float]]:
    from dodo_dsl.opendlv.messages.codec import MessageError  # protobuf and numpy take longer to load than the compiler
    from dodo_dsl.opendlv.messages.message_set import MessageSet
    from dodo_dsl.opendlv.recordings.recording import Recording

    messages = MessageSet.standard()
    wanted, begin = messages.id(_FRAME), messages.id("dodo.TestBegin")
    start: int | None = None
    with Recording(path) as recording:
        for envelope in recording.envelopes(recording.rows({wanted, begin})):
            if envelope.data_type == begin:
                start = envelope.sample_time
                continue
            try:
                frame: Any = messages.decode(envelope.data_type, envelope.payload)
            except MessageError:
                continue
            if not all(map(math.isfinite, (frame.x, frame.y, frame.qx, frame.qy, frame.qz, frame.qw))):
                continue
            heading = math.atan2(2 * (frame.qw * frame.qz + frame.qx * frame.qy), 1 - 2 * (frame.qy**2 + frame.qz**2))
            start = envelope.sample_time if start is None else start
            yield frame.x, frame.y, heading, (envelope.sample_time - start) / 1e6


def read_ground(place: Path) -> Ground:
    """The parts of an OpenDLV map that a picture shows; an unreadable map is empty: services report its errors."""
    try:
        raw = json.loads((place / "map.json" if place.is_dir() else place).read_text(encoding="utf-8"))
        models = [
            (_colour(model.get("color")), [(float(i[0]), float(i[1])) for i in model.get("instances", [])])
            for model in raw.get("model", [])
        ]
        lines = [(str(o.get("name", "")), _lines(o.get("lines", []))) for o in raw.get("obstacles", [])]
    except (OSError, ValueError, TypeError, IndexError, AttributeError, KeyError):
        return Ground()
    return Ground(models, lines)


def _colour(raw: Any) -> tuple[float, float, float]:
    return (float(raw[0]), float(raw[1]), float(raw[2])) if isinstance(raw, list) else (0.5, 0.5, 0.5)


def _lines(raw: list[Any]) -> list[tuple[float, float, float, float]]:
    rows = raw if raw and isinstance(raw[0], list) else [raw]
    return [(float(r[0]), float(r[1]), float(r[2]), float(r[3])) for r in rows if len(r) == 4]
