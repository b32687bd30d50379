"""The drive in a recording: the vehicle's path over the map's cones and lines."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.attitude import heading_of
from dodo_dsl.plan.model import Plan

MAP = "map-path"
"""The parameter of all services that read the test's map."""
_FRAME = "opendlv.sim.Frame"
_GREY = 0.5, 0.5, 0.5

Point = tuple[float, float]


@dataclass(frozen=True)
class Ground:
    """The map from above: model positions in metres by colour (RGB, 0 to 1), named lines, and what moves on it."""

    models: list[tuple[tuple[float, float, float], list[Point]]] = field(default_factory=list)
    lines: list[tuple[str, list[tuple[float, float, float, float]]]] = field(default_factory=list)
    moving: tuple[map_file.ModelEntry, ...] = ()
    """Models at the frames of vehicles."""


@dataclass(frozen=True)
class Way:
    """The sender stamp of the vehicle's frames, its size in m, and the roles of the map's obstacles by their names."""

    frame: int = 0
    length: float = 0.0
    width: float = 0.0
    roles: Mapping[str, str] = field(default_factory=dict)

    @property
    def goal(self) -> str:
        """The obstacle to be reached; empty if there is none."""
        return next((name for name, role in self.roles.items() if role == "goal"), "")


@dataclass(frozen=True)
class DrivenPath:
    """A path in the world frame: x and y in metres, heading in radians, and seconds since its start."""

    path: list[tuple[float, float, float, float]]
    ground: Ground
    length: float = 0.0
    width: float = 0.0
    goal: str = ""


def read_drive(plan: Plan, folder: Path, recording: Path, way: Way) -> DrivenPath | None:
    """The drive of a test, or None when its recording holds no Frame; ``way`` as its judges recorded it."""
    paths = _paths(recording) if recording.is_file() else {}
    path = paths.get(way.frame) or next(iter(paths.values()), [])
    return DrivenPath(path, ground_of(plan, folder), way.length, way.width, way.goal) if path else None


def ground_of(plan: Plan, folder: Path) -> Ground:
    """The map of a test, of which its judges come last; ``folder`` is the compiled test's."""
    maps = [flag.value for service in plan.services for flag in service.flags if flag.name == MAP]
    return read_ground(folder / FILES / maps[-1]) if maps else Ground()


def _paths(path: Path) -> dict[int, list[tuple[float, float, float, float]]]:
    """The path of each sender of frames."""
    found: dict[int, list[tuple[float, float, float, float]]] = {}
    for stamp, *pose in _poses(path):
        x, y, heading, time = pose
        found.setdefault(stamp, []).append((x, y, heading, time))
    return found


def _poses(path: Path) -> Iterator[tuple[int, float, float, float, float]]:
    from dodo_dsl.opendlv.message_set import (
        MessageError,  # protobuf and numpy take longer to load than the compiler
        MessageSet,
    )
    from dodo_dsl.opendlv.recording import Recording

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
            heading = heading_of(frame.qx, frame.qy, frame.qz, frame.qw)
            if heading is None or not math.isfinite(frame.x + frame.y):
                continue
            start = envelope.sample_time if start is None else start
            yield envelope.sender_stamp, frame.x, frame.y, heading, (envelope.sample_time - start) / 1e6


def read_ground(place: Path) -> Ground:
    """The parts of an OpenDLV map that a picture shows; an unreadable map is empty: services report its errors."""
    found, _ = map_file.problems(place)
    if found is None:
        return Ground()
    models = [
        (colour_of(model), [each.position[:2] for each in model.instances]) for model in found.models if model.instances
    ]
    try:
        lines = [(name, [(*a, *b) for a, b in each]) for name, each in map_file.read_obstacles(found.path).items()]
        lines += [(name, _edges(each)) for name, each in map_file.footprints(found.blocks).items() if each]
    except InputError:
        lines = []
    moving = tuple(model for model in found.models if model.frames)
    return Ground(models, lines, moving)


def _edges(outlines: Iterable[map_file.Outline]) -> list[tuple[float, float, float, float]]:
    return [(*a, *b) for corners in outlines for a, b in pairwise([*corners, corners[0]])]


def colour_of(model: map_file.ModelEntry) -> tuple[float, float, float]:
    """Red, green and blue from 0 to 1; grey for a texture, or materials."""
    return model.paint if isinstance(model.paint, tuple) else _GREY
