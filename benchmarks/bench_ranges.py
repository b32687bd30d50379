"""What range sensors cost: a step of one with eight rays and a lidar's scan beside shapely, and a drive in lockstep.

    python benchmarks/bench_ranges.py

Both look from the same positions at the same outlines, of 100 cones, and for the lidar of 96 blocks and four walls.
shapely looks for the obstacles that a ray may meet in its tree, and for the nearest point that the ray has in common
with one. Processor time, of one core.
"""

import json
import math
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, rate_row, report
from dodo_dsl import package_data
from services.lidar.model import Lidar, Scanner
from services.range_finder.model import Device, RangeFinder, Sensor
from services.scene.outlines import Array, Cut, Outlines, Place

ROOT = Path(__file__).resolve().parents[1]
OBSTACLES, RAYS, HEIGHT = 100, 8, 0.02
SCAN_RAYS, SCAN_GOAL_MS = 1080, 2.0
ROUNDS, STEPS = 9, 400
SENSORS = "id: [0, 2, 4, 5, 6, 7], yaw: [0 deg, 180 deg, 30 deg, -30 deg, 150 deg, -150 deg]"
SCAN = f"lidar, {SCAN_RAYS} rays, {OBSTACLES} obstacles, a scan"
STEP, DRIVE = f"range-finder, {RAYS} rays, {OBSTACLES} obstacles, a step", "drive with eight range sensors, lockstep"


def make_map(folder: Path) -> Path:
    """An oval of 50 cones inside 50 others."""
    shutil.copy(package_data.registry() / "maps" / "straight" / "cone.obj", folder / "cone.obj")
    angles = np.arange(OBSTACLES // 2) * 4 * math.pi / OBSTACLES
    places = [[r * math.cos(a), r * math.sin(a), 0.0, 0.0] for r in (1.75, 2.25) for a in angles]
    cones = {"name": "cone", "file": "cone.obj", "color": [1, 1, 0], "instances": places}
    (folder / "map.json").write_text(json.dumps({"model": [cones]}))
    return folder


def drive() -> list[Place]:
    """Along the oval's middle, counter-clockwise."""
    turns = [2 * math.pi * k / STEPS for k in range(STEPS)]
    return [Place(2 * math.cos(t), 2 * math.sin(t), 0.0, t + math.pi / 2) for t in turns]


def make_room(folder: Path) -> Path:
    """The oval's cones as blocks, two of each circle left out, between four walls."""
    angles = np.delete(np.arange(OBSTACLES // 2), (0, 25)) * 4 * math.pi / OBSTACLES
    places = [[r * math.cos(a), r * math.sin(a), 0.5, a] for r in (1.6, 2.4) for a in angles]
    block = {"name": "post", "dimension": [0.06, 0.04, 1], "color": [1, 0, 0], "instances": places}
    walls = [[-3, -3, 3, -3], [3, -3, 3, 3], [3, 3, -3, 3], [-3, 3, -3, -3]]
    (folder / "map.json").write_text(json.dumps({"block": [block], "obstacles": [{"name": "walls", "lines": walls}]}))
    return folder


def with_shapely(cut: Cut, angles: Array, far: float) -> Callable[[Place], Array]:
    """The same distance along each ray by shapely's tree and geometry."""
    ends = cut.starts + cut.edges
    bodies = [
        shapely.multilinestrings([[a, b] for a, b in zip(cut.starts[f : f + n], ends[f : f + n], strict=True)])
        for f, n in zip(cut.first.tolist(), cut.counts.tolist(), strict=True)
    ]
    tree = shapely.STRtree(bodies)

    def look(place: Place) -> Array:
        origin, nearest = np.array([place.x, place.y]), np.full(len(angles), np.inf)
        turned = place.yaw + angles
        tips = origin + far * np.column_stack([np.cos(turned), np.sin(turned)])
        rays = shapely.linestrings(np.stack([np.broadcast_to(origin, tips.shape), tips], axis=1))
        ray, body = tree.query(rays, predicate="intersects")
        points = shapely.intersection(rays[ray], tree.geometries[body])
        np.minimum.at(nearest, ray, shapely.distance(points, shapely.Point(origin)))
        return nearest

    return look


def microseconds(look: Callable[[Place], object], every: int = 1) -> float:
    """Processor time of a step."""
    began, places = time.process_time(), drive()[::every]
    for place in places:
        look(place)
    return (time.process_time() - began) / len(places) * 1e6


def step_row(ours: Sequence[float], theirs: Sequence[float]) -> Row:
    return cost_row(STEP, "us", ours, "shapely", theirs, goal=Goal(200.0, "value"))


def scan_row(ours: Sequence[float], theirs: Sequence[float]) -> Row:
    return cost_row(SCAN, "ms", ours, "shapely", theirs, goal=Goal(SCAN_GOAL_MS, "value"))


def drive_row(ours: Sequence[float]) -> Row:
    return rate_row(DRIVE, "x real time", ours, note="no peer")


def beside(folder: Path, budget: Budget) -> None:
    device = Device(cone=math.radians(55), rays=RAYS)
    outlines = Outlines(make_map(folder))
    finder = RangeFinder(outlines, [Sensor(0, z=HEIGHT)], device)
    peer = with_shapely(outlines.at(HEIGHT), device.angles(), device.far)
    seen = [(float(finder.distances(place, {})[0]), float(peer(place).min())) for place in drive()]
    assert all(math.isclose(ours, theirs, abs_tol=1e-9) for ours, theirs in seen), "both see the same"
    assert min(seen)[0] < device.far, "and something"
    rounds = [
        (microseconds(lambda place: finder.readings(place, {})), microseconds(peer))
        for _ in budget.rounds(ROUNDS, until=0.4)
    ]
    ours, theirs = zip(*rounds, strict=True)
    report(step_row(ours, theirs))
    print(f"{STEP}: {np.median(ours):.0f} us, shapely {np.median(theirs):.0f} us")


def scans(folder: Path, budget: Budget) -> None:
    lidar, outlines = Lidar(z=HEIGHT, rays=SCAN_RAYS), Outlines(make_room(folder), ["walls"])
    scanner = Scanner(outlines, lidar)
    angles = -math.pi + lidar.increment * np.arange(SCAN_RAYS)
    peer = with_shapely(outlines.at(HEIGHT), angles, lidar.far)
    for place in drive()[::40]:
        ours, theirs = scanner.distances(place, {}), peer(place)
        assert np.isfinite(ours).all() and np.abs(ours - theirs).max() < 1e-9, "both see the same"
    rounds = [
        (microseconds(lambda place: scanner.ranges(place, {})) / 1e3, microseconds(peer, 20) / 1e3)
        for _ in budget.rounds(ROUNDS, until=0.6)
    ]
    found, reference = zip(*rounds, strict=True)
    report(scan_row(found, reference))
    print(f"{SCAN}: {np.median(found):.2f} ms, shapely {np.median(reference):.2f} ms")


def drives(folder: Path, budget: Budget) -> None:
    """The test of examples/ranges, with six ultrasonic sensors beside its two infrared ones."""
    shutil.copytree(ROOT / "examples" / "ranges", folder / "ranges", ignore=shutil.ignore_patterns("__pycache__"))
    spec = next((folder / "ranges" / "tests").glob("*/*.dodo.yml"))
    text = spec.read_text()
    two = "id: [0, 2], x: [15 cm, -15 cm], yaw: [0 deg, 180 deg]"
    assert text.count(two) == 1
    spec.write_text(text.replace(two, SENSORS))
    rates = [times_real_time(folder / "ranges") for _ in budget.rounds(5)]
    report(drive_row(rates))
    print(f"{DRIVE}: {np.median(rates):.1f} times real time")


def times_real_time(folder: Path) -> float:
    command = [sys.executable, "-m", "dodo_dsl", "run", "--report", "report"]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    (test,) = json.loads((folder / "report" / "results.json").read_text())["tests"]
    facts: dict[str, Any] = test
    return float(facts["sim_s"] / facts["execution_s"])


def main() -> int:
    budget = Budget.given()
    first, scan, second = step_row([], []), scan_row([], []), drive_row([])
    plan(first, scan, second)
    with tempfile.TemporaryDirectory() as name:
        with attempt(first):
            beside(Path(name), budget)
        with attempt(scan):
            scans(Path(name), budget)
        with attempt(second):
            drives(Path(name), budget)
    return 0


if __name__ == "__main__":
    sys.exit(main())
