"""Makes the tables beside this file: python tests_registry/targets/make_targets.py [FOLDER].

A table has a row every 0.1 s: where the beacon is (``x``, ``y`` in m, ``yaw`` in rad) and the steering request in rad
that is reasonable there (``groundSteering``). The beacon drives at SPEED, on ``left-curve`` along the centre line of
the track, on ``straight`` askew from the left half of the lane into the right one. The steering is not an
application's: it leads from where the beacon is onto the centre line LOOK m ahead (the circle of pure pursuit), for
Kiwi's wheelbase and the gain with which the car takes a request. LOOK is where a driver sees both rows: the camera
sees cones 0.25 m beside it from 0.41 m on, and the nearest of a row, 0.25 m apart, is on the average half a gap
farther.

``rig-straight`` is for the dynamic rig, which has to follow: it gains speed with GAIN up to RIG_SPEED, brakes as
gently, and stands at last.
"""

import importlib.util
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dodo_dsl.cli.new_map import ahead

HERE = Path(__file__).resolve().parent
SPEED, PERIOD = 0.5, 0.1
LOOK = 0.54
WHEELBASE = 0.224
REQUEST_PER_ANGLE, REQUEST_LIMIT = 0.290888 / 0.6, 0.290888
ASKEW = (-0.1, 0.0, math.radians(86))
RIG_SPEED, GAIN, RIG_WAY, STAND = 0.35, 0.35, 1.2, 0.5
"""m/s, m/s2, m and s: well within the rig's 1 m/s, 0.5 m/s2 and workspace."""
RIG_ASKEW = (-0.8, 0.075, math.radians(-7))
Place = tuple[float, float, float]


def _maps() -> Any:
    spec = importlib.util.spec_from_file_location("make_maps", HERE.parent / "maps" / "make_maps.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


MAPS = _maps()


def centre(name: str, along: float) -> Place:
    """The position on a track's centre line after so many metres; it goes straight on behind the finish."""
    x, y, heading = MAPS.TRACKS[name].start
    for section in [*MAPS.TRACKS[name].sections, MAPS.Section(100.0)]:
        part = min(1.0, along / section.length)
        forward, left, turned = section.end(part)
        c, s = math.cos(heading), math.sin(heading)
        x, y, heading = x + c * forward - s * left, y + s * forward + c * left, heading + turned
        along -= section.length
        if along <= 0:
            break
    return x, y, heading


def steering(place: Place, aim: Place) -> float:
    """The request in rad that leads onto the circle through the aim; left is positive."""
    x, y, heading = place
    dx, dy = aim[0] - x, aim[1] - y
    left = dy * math.cos(heading) - dx * math.sin(heading)
    angle = math.atan(WHEELBASE * 2 * left / (dx**2 + dy**2))
    return max(-REQUEST_LIMIT, min(REQUEST_LIMIT, REQUEST_PER_ANGLE * angle))


def evenly(length: float) -> list[float]:
    """How far the beacon has come after each PERIOD (m)."""
    return [row * SPEED * PERIOD for row in range(round(length / (SPEED * PERIOD)) + 1)]


def gently() -> list[float]:
    """The same for the rig."""
    ramp = RIG_SPEED / GAIN
    took = RIG_WAY / RIG_SPEED + ramp
    rows = math.ceil((took + STAND) / PERIOD)
    return [_gone(min(row * PERIOD, took), took, ramp) for row in range(rows + 1)]


def _gone(time: float, took: float, ramp: float) -> float:
    """A trapezium of speed."""
    if time > took / 2:
        return RIG_WAY - _gone(took - time, took, ramp)
    return GAIN * time**2 / 2 if time < ramp else RIG_SPEED * (time - ramp / 2)


def table(name: str, ways: list[float], place_at: Callable[[float], Place]) -> str:
    lines = ["time,x,y,yaw,groundSteering"]
    for row, along in enumerate(ways):
        place = place_at(along)
        values = (*place, steering(place, centre(name, along + LOOK)))
        lines.append(",".join([f"{row * PERIOD:.1f}", *(f"{round(v, 5) + 0.0:.5f}" for v in values)]))
    return "\n".join(lines) + "\n"


def make(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    tables = {
        "straight": table("straight", evenly(2.75), lambda along: ahead(ASKEW, along)),
        "left-curve": table("left-curve", evenly(3.8), lambda along: centre("left-curve", along)),
        "rig-straight": table("rig-straight", gently(), lambda along: ahead(RIG_ASKEW, along)),
    }
    for name, text in tables.items():
        (folder / f"{name}.csv").write_text(text)


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
