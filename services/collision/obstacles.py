"""The obstacles of an OpenDLV map: lines on the ground that have a name."""

import difflib
from collections.abc import Sequence
from pathlib import Path

import shapely

from dodo_dsl.opendlv.inputs import obstacles
from dodo_dsl.opendlv.inputs.json_node import MapError


class ObstaclesError(ValueError):
    """A map that cannot be read, or that lacks an obstacle; the message names file and place."""


def load(path: Path) -> dict[str, shapely.MultiLineString]:
    """The obstacles of the map in a folder (its `map.json`) or of the map file itself, by name, in metres.

    Obstacles of one name are one. Raises ObstaclesError.
    """
    try:
        found = obstacles.read(path)
    except MapError as error:
        raise ObstaclesError(str(error)) from None
    return {name: shapely.MultiLineString(lines) for name, lines in found.items()}


def pick(
    known: dict[str, shapely.MultiLineString], names: Sequence[str], parameter: str, path: Path
) -> dict[str, shapely.MultiLineString]:
    """Those obstacles that a parameter names, prepared for many queries; MapError for an unknown name."""
    chosen = {}
    for name in names:
        if name not in known:
            raise ObstaclesError(f"--{parameter}: {_unknown(name, list(known), path)}")
        shapely.prepare(known[name])
        chosen[name] = known[name]
    return chosen


def _unknown(name: str, known: list[str], path: Path) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"it has {', '.join(sorted(known)) or 'none'}"
    return f"the map {path} has no obstacle {name!r}; {hint}"
