"""Images a second: the virtual camera beside OpenGL on llvmpipe, one core, 1280 x 720, 90 cones on a textured floor.

    python benchmarks/bench_camera.py [FOLDER]

Both draw the same drive, in turns; each image ends in memory. FOLDER keeps the images of both. The same with a maze
of 136 textured blocks follows, and the cost of each condition, alone. Without moderngl or EGL only the virtual camera
is measured.
"""

import json
import math
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, rate_row, report
from benchmarks.pictures.gl_peer import GlPeer, ssim
from dodo_dsl import package_data
from services.scene.camera import CameraMotion, CameraPose, Pinhole, still
from services.scene.lens import Distortion, Lens
from services.scene.raster import Image
from services.scene.render import Renderer
from services.scene.scene import SceneOptions, load_scene
from services.scene.shading import Light
from services.scene.truth import SceneTruth, classes_of
from services.virtual_camera.optics import Optics, Sensor

SIZE, FOVY = (1280, 720), math.radians(48.8)
CONES = 90
ROUNDS, FRAMES = 7, 40
NO_PEER = "moderngl with EGL is not here"
BODY = CameraPose.at(0, 0, 0)
ONE_THREAD = dict.fromkeys(("LP_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


def make_map(folder: Path) -> Path:
    """An oval of 45 yellow cones inside 45 blue ones, on the shipped textured floor."""
    straight = package_data.registry() / "maps" / "straight"
    for name in ("cone.obj", "floor.png"):
        shutil.copy(straight / name, folder / name)
    angles = np.arange(CONES // 2) * 2 * math.pi / (CONES // 2)
    rows = {
        name: [[reach * math.cos(a), reach * math.sin(a), 0.0, 0.0] for a in angles]
        for name, reach in (("cone_yellow", 1.75), ("cone_blue", 2.25))
    }
    colours = {"cone_yellow": [1.0, 0.85, 0.0], "cone_blue": [0.0, 0.1, 0.9]}
    models = [{"name": n, "file": "cone.obj", "color": colours[n], "instances": rows[n]} for n in rows]
    floor = {
        "name": "floor",
        "dimension": [10.0, 10.0, 0.2],
        "textureFile": "floor.png",
        "textureSize": [1.0, 1.0],
        "instances": [[0.0, 0.0, -0.1, 0.0]],
    }
    (folder / "map.json").write_text(json.dumps({"model": models, "block": [floor]}))
    return folder


BLOCKS, CELL, CELLS = 136, 0.6, 12


def make_maze(folder: Path) -> Path:
    """Walls of 5 cm to 1 m, 2 cm thick, 15 cm above a floor, on the edges of 12 by 12 cells; a ceiling."""
    straight = package_data.registry() / "maps" / "straight"
    shutil.copy(straight / "floor.png", folder / "floor.png")
    random = np.random.RandomState(36)
    edges = [(x, y, turn) for x in range(CELLS) for y in range(CELLS) for turn in (0.0, 1.571)]
    texture = {"textureFile": "floor.png", "textureSize": [1.0, 1.0]}
    flat = {"dimension": [10.0, 10.0, 0.2], **texture}
    blocks = [
        {"name": "floor", **flat, "instances": [[0.0, 0.0, -0.1, 0.0]]},
        {"name": "ceiling", **flat, "instances": [[0.0, 0.0, 1.9, 0.0]]},
    ]
    for number, length in zip(
        random.permutation(len(edges))[:BLOCKS].tolist(), random.uniform(0.05, 1, BLOCKS), strict=True
    ):
        x, y, turn = edges[number]
        place = [(x + (turn == 0.0) / 2 - CELLS / 2) * CELL, (y + (turn > 0.0) / 2 - CELLS / 2) * CELL, 0.0, turn]
        blocks.append({"name": "wall", "dimension": [round(length, 2), 0.02, 0.3], **texture, "instances": [place]})
    (folder / "map.json").write_text(json.dumps({"block": blocks}))
    return folder


def wander() -> list[CameraPose]:
    """In the middle of cells, looking all round."""
    random = np.random.RandomState(37)
    cells, turns = random.randint(0, CELLS, (FRAMES, 2)), random.uniform(-math.pi, math.pi, FRAMES)
    places = ((cells + 0.5 - CELLS / 2) * CELL).tolist()
    return [CameraPose.at(x, y, 0.095, yaw=turn) for (x, y), turn in zip(places, turns.tolist(), strict=True)]


def drive() -> list[CameraPose]:
    """Along the oval's middle, counter-clockwise."""
    turns = [2 * math.pi * k / FRAMES for k in range(FRAMES)]
    return [CameraPose.at(2 * math.cos(t), 2 * math.sin(t), 0.095, yaw=t + math.pi / 2) for t in turns]


def rate(draw: Callable[[CameraPose], object], poses: Sequence[CameraPose]) -> float:
    """Images a second from these poses."""
    start = time.perf_counter()
    for pose in poses:
        draw(pose)
    return len(poses) / (time.perf_counter() - start)


def peer(folder: Path) -> GlPeer | None:
    try:
        return GlPeer(folder, *SIZE, FOVY)
    except Exception as error:  # noqa: BLE001 - moderngl raises just that without EGL
        print(f"{NO_PEER} ({type(error).__name__}: {error}): the virtual camera alone")
        return None


@dataclass(frozen=True)
class Scenery:
    """What both draw; ``ratio`` is how many times the peer's rate is to be reached, ``alike`` the least SSIM."""

    what: str
    make: Callable[[Path], Path]
    poses: Callable[[], list[CameraPose]]
    ratio: float
    alike: float

    def speed(self, ours: Sequence[float], **rest: Any) -> Row:
        return rate_row(self.what, "pictures/s", ours, goal=Goal(self.ratio), **rest)

    def likeness(self, values: Sequence[float]) -> Row:
        return rate_row(f"{self.what}, SSIM with the peer at worst", "", values, goal=Goal(self.alike, of="value"))


OVAL = Scenery("virtual camera", make_map, drive, 3, 0.95)
MAZE = Scenery(f"virtual camera, {BLOCKS} blocks", make_maze, wander, 1, 0.95)


def cost_of(condition: str, ours: Sequence[float], without: Sequence[float]) -> Row:
    return cost_row(f"virtual camera, {condition}", "ms an image", ours, "no condition", without)


def beside(scenery: Scenery, folder: Path, keep: Path | None, budget: Budget, until: float) -> None:
    """The rates of both in turns, and how alike their images are."""
    poses = scenery.poses()
    camera, gl = Renderer(load_scene(folder), *SIZE, FOVY), peer(folder)
    image = np.empty((SIZE[1], SIZE[0], 4), np.uint8)

    def ours(pose: CameraPose) -> Image:
        return camera.render(pose, image)

    def theirs(pose: CameraPose) -> Image:
        assert gl is not None
        view = camera.camera.view(pose)
        return gl.render(view.position, view.axes)

    draws = [ours, theirs] if gl else [ours]
    columns = list(
        zip(*([rate(draw, poses) for draw in draws] for _ in budget.rounds(ROUNDS, until=until)), strict=True)
    )
    rest = {"peer": "moderngl on llvmpipe", "theirs": columns[1]} if gl else {"note": NO_PEER}
    row = scenery.speed(columns[0], **rest)
    report(row)
    print(f"{scenery.what}\nvirtual-camera {median(row.ours):7.1f} images/s")
    if gl is None:
        plan(scenery.likeness([]), note=NO_PEER)
        return
    print(f"moderngl       {median(row.theirs):7.1f} images/s on {gl.name}")
    print(f"ratio          {median(row.ratios):7.2f} (target {scenery.ratio})")
    alike = [ssim(ours(pose), theirs(pose)) for pose in poses]
    report(scenery.likeness([min(alike)]))
    print(f"SSIM           {min(alike):7.4f} at worst, {np.mean(alike):.4f} on average (target {scenery.alike})")
    if keep is not None:
        for number, pose in enumerate(poses[::10]):
            name = f"{scenery.make.__name__.removeprefix('make_')}-{number}"
            cv2.imwrite(str(keep / f"{name}-virtual-camera.png"), ours(pose))
            cv2.imwrite(str(keep / f"{name}-moderngl.png"), theirs(pose))


CONDITIONS: dict[str, tuple[SceneOptions, dict[str, object]]] = {
    "nothing": (SceneOptions(), {}),
    "light": (SceneOptions(light=Light.of_flags(90, 30, 0.4)), {}),
    "clutter of 40": (SceneOptions(clutter=40), {}),
    "exposure": (SceneOptions(), {"sensor": Sensor(exposure=0.4)}),
    "noise": (SceneOptions(), {"sensor": Sensor(noise=0.03)}),
    "shutter 20 ms": (SceneOptions(), {"shutter": 0.02}),
    "distortion": (SceneOptions(), {"lens": Lens(Pinhole(*SIZE, FOVY), Distortion(-0.25, 0.05))}),
    "boxes": (SceneOptions(), {}),
}


def condition(folder: Path, name: str) -> Callable[[CameraPose], object]:
    options, parts = CONDITIONS[name]
    optics = Optics(Pinhole(*SIZE, FOVY), **parts)  # type: ignore[arg-type]
    renderer = Renderer(load_scene(folder, options), optics.wide.width, optics.wide.height, optics.wide.fovy)
    truth = SceneTruth(renderer, classes_of([], renderer.bodies.names), 0.25, 4.0) if name == "boxes" else None
    out = np.empty((SIZE[1], SIZE[0], 4), np.uint8)

    def draw(pose: CameraPose) -> None:
        forward = pose.rotation[:, 0] * 0.5
        motion = CameraMotion(pose, forward, np.array([0, 0, 0.3])) if "shutter" in parts else still(pose)
        optics.expose(renderer, motion, BODY, int(pose.position[0] * 1e6) % 10**9, out)
        if truth is not None:
            truth.boxes(pose)

    return draw


def costs(folder: Path, budget: Budget) -> Iterator[str]:
    """What each condition adds to an image, in ms, measured in turns with none."""
    draws = {name: condition(folder, name) for name in CONDITIONS}
    rounds = [{name: 1000 / rate(draw, drive()[::4]) for name, draw in draws.items()} for _ in budget.rounds(ROUNDS)]
    for name in list(CONDITIONS)[1:]:
        report(cost_of(name, [r[name] for r in rounds], [r["nothing"] for r in rounds]))
        added = median(r[name] - r["nothing"] for r in rounds)
        times = median(r[name] / r["nothing"] for r in rounds)
        yield f"{name:<14} {added:+7.2f} ms an image, {times:.2f} times the time"


@contextmanager
def map_folder(scenery: Scenery) -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as name:
        yield scenery.make(Path(name))


def main(argv: list[str]) -> int:
    os.sched_setaffinity(0, {sorted(os.sched_getaffinity(0))[-1]})
    cv2.setNumThreads(1)
    keep = Path(argv[0]) if argv else None
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
    budget = Budget.given()
    first, maze = ([each.speed([]), each.likeness([])] for each in (OVAL, MAZE))
    others = [cost_of(name, [], []) for name in list(CONDITIONS)[1:]]
    plan(*first, *maze, *others)
    with map_folder(MAZE) as walls, map_folder(OVAL) as folder:
        with attempt(*first):
            beside(OVAL, folder, keep, budget, 0.3)
        with attempt(*maze):
            beside(MAZE, walls, keep, budget, 0.5)
        with attempt(*others):
            for line in costs(folder, budget):
                print(line)
    return 0


if __name__ == "__main__":
    if not ONE_THREAD.items() <= os.environ.items():  # libraries read these when they are loaded
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **ONE_THREAD})
    sys.exit(main(sys.argv[1:]))
