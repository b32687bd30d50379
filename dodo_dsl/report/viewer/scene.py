"""The world from above: the map's cones and lines by their purpose, and how large the vehicle is."""

from pathlib import Path
from typing import Any

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.report.pictures.trajectory import Ground, read_ground
from dodo_dsl.report.viewer.encoded import shown

FRAME = "opendlv.sim.Frame"
_MOST = 20_000
"""Points and lines of a map that are drawn."""


def flags_of(service: PlannedService) -> dict[str, str]:
    return {flag.name: flag.value for flag in service.flags}


def scene(plan: Plan, folder: Path) -> dict[str, Any]:
    """The map under the test's path, as the judges see it; ``folder`` is the compiled test's."""
    flags = {name: value for s in plan.services for name, value in flags_of(s).items() if s.judge or name == "map-path"}
    ground = read_ground(folder / FILES / flags["map-path"]) if "map-path" in flags else Ground()
    gates = _names(flags.get("gates", ""))
    roles = dict.fromkeys(_names(flags.get("walls", "")), "wall") | dict.fromkeys(gates, "gate")
    roles[flags.get("goal", "")] = "goal"
    return {
        "models": [{"colour": list(colour), "points": points[:_MOST]} for colour, points in ground.models],
        "lines": [
            {"name": shown(name, 80), "role": roles.get(name, "other"), "lines": lines[:_MOST]}
            for name, lines in ground.lines
        ],
        "gates": [shown(name, 80) for name in gates],
        "length": _number(flags.get("length")),
        "width": _number(flags.get("width")),
        "frame": {"message": FRAME, "sender": int(_number(flags.get("frame-id")))},
    }


def _names(text: str) -> list[str]:
    return [name for name in text.split(",") if name]


def _number(text: str | None) -> float:
    try:
        return float(text or 0)
    except ValueError:
        return 0.0
