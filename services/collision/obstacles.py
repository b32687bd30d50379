"""The obstacles of an OpenDLV map: lines on the ground that have a name."""

import difflib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import shapely

from dodo_dsl.opendlv import regular_file

NUMBERS = 4


class ObstaclesError(ValueError):
    """A map that cannot be read, or that lacks an obstacle; the message names file and place."""


def load(path: Path) -> dict[str, shapely.MultiLineString]:
    """The obstacles of the map in a folder (its `map.json`) or of the map file itself, by name, in metres.

    Obstacles of one name are one. Raises MapError.
    """
    file = path if path.suffix == ".json" else path / "map.json"
    try:
        document = json.loads(regular_file.text(file))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ObstaclesError(f"{file}: cannot be read as a map: {reason}") from None
    entries = document.get("obstacles", []) if isinstance(document, dict) else None
    if not isinstance(entries, list):
        raise ObstaclesError(f"{file}: expected an object with a list of obstacles")
    lines: dict[str, list[list[tuple[float, float]]]] = {}
    for index, entry in enumerate(entries):
        name, segments = _obstacle(entry, f"{file}: obstacles[{index}]")
        lines.setdefault(name, []).extend(segments)
    return {name: shapely.MultiLineString(segments) for name, segments in lines.items()}


def pick(
    obstacles: dict[str, shapely.MultiLineString], names: Sequence[str], parameter: str, path: Path
) -> dict[str, shapely.MultiLineString]:
    """Those obstacles that a parameter names, prepared for many queries; MapError for an unknown name."""
    chosen = {}
    for name in names:
        if name not in obstacles:
            raise ObstaclesError(f"--{parameter}: {_unknown(name, list(obstacles), path)}")
        shapely.prepare(obstacles[name])
        chosen[name] = obstacles[name]
    return chosen


def _unknown(name: str, known: list[str], path: Path) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"it has {', '.join(sorted(known)) or 'none'}"
    return f"the map {path} has no obstacle {name!r}; {hint}"


def _obstacle(entry: Any, place: str) -> tuple[str, list[list[tuple[float, float]]]]:
    if not isinstance(entry, dict) or not isinstance(entry.get("name"), str) or not entry["name"]:
        raise ObstaclesError(f"{place}: expected an object with a name")
    lines = entry.get("lines")
    if not isinstance(lines, list) or not lines:
        raise ObstaclesError(f"{place}.lines: expected a list of lines [x1, y1, x2, y2]")
    if not isinstance(lines[0], list):
        return entry["name"], [_segment(lines, f"{place}.lines")]
    return entry["name"], [_segment(line, f"{place}.lines[{index}]") for index, line in enumerate(lines)]


def _segment(line: Any, place: str) -> list[tuple[float, float]]:
    numbers = line if isinstance(line, list) else []
    if len(numbers) != NUMBERS or not all(_is_number(value) for value in numbers):
        raise ObstaclesError(f"{place}: expected four numbers [x1, y1, x2, y2] in metres")
    x1, y1, x2, y2 = (float(value) for value in numbers)
    return [(x1, y1), (x2, y2)]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
