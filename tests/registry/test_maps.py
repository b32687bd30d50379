"""The maps of the registry: as their generator makes them, drivable, and good to look at."""

import importlib.util
import json
import math
from itertools import pairwise

import cv2
import numpy as np
import pytest

from dodo_dsl import package_data
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene

MAPS = package_data.registry() / "maps"
OPEN = ["left-curve", "rig-straight", "straight"]
TRACKS = [*OPEN, "kiwi-track"]
NAMES = sorted([*TRACKS, "rig-oval", "static-rig", "two-cars"])
STARTS = {"rig-straight": (-0.75, 0.0, 0.0), "rig-oval": (-0.2, -0.6, 0.0)}
"""Where a car starts: x, y (m) and heading (rad)."""


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    spec = importlib.util.spec_from_file_location("make_maps", MAPS / "make_maps.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = tmp_path_factory.mktemp("maps")
    module.make(folder)
    return folder


def content(name: str) -> dict:
    return json.loads((MAPS / name / "map.json").read_text())


def cones(name: str, colour: str) -> np.ndarray:
    (model,) = (m for m in content(name)["model"] if m["name"] == f"cone_{colour}")
    return np.array(model["instances"])[:, :2]


def start(name: str) -> tuple[float, float, float]:
    return STARTS.get(name, (0.0, 0.0, math.pi / 2))


@pytest.mark.parametrize("name", NAMES)
def test_a_map_is_what_its_generator_makes(generated, name):
    files = {p.name for p in (MAPS / name).iterdir()}
    assert files == {p.name for p in (generated / name).iterdir()}
    for file in files - {"floor.png"}:
        assert (MAPS / name / file).read_bytes() == (generated / name / file).read_bytes()
    ours, new = (cv2.imread(str(f / name / "floor.png"), cv2.IMREAD_UNCHANGED) for f in (MAPS, generated))
    assert np.array_equal(ours, new)


YELLOW, BLUE = ((20, 80, 80), (30, 250, 210)), ((105, 60, 25), (120, 215, 90))
"""Ranges of hue, saturation and value of OpenCV in which real cones are, as docs/reference/maps.md says."""


def hues(image: np.ndarray, colour: tuple[tuple[int, int, int], tuple[int, int, int]]) -> tuple[int, float]:
    """How many pixels have a colour, and their mean column; all others of its hues are grey."""
    low, high = colour
    hsv = cv2.cvtColor(image[..., :3], cv2.COLOR_BGR2HSV)
    found = cv2.inRange(hsv, low, high) > 0
    of_hue = cv2.inRange(hsv, (low[0], 40, 0), (high[0], 255, 255)) > 0
    assert not (of_hue & ~found).any(), hsv[of_hue & ~found][:5]
    return int(found.sum()), float(np.flatnonzero(found.any(axis=0)).mean()) if found.any() else math.nan


@pytest.mark.parametrize("name", NAMES)
def test_from_the_start_a_camera_sees_yellow_on_its_left_and_blue_on_its_right(name):
    renderer = Renderer(load_scene(MAPS / name), 640, 480, math.radians(48.8))
    x, y, heading = (0.0, 0.0, 0.0) if name == "static-rig" else start(name)
    image = renderer.render(CameraPose.at(x, y, 0.095, yaw=heading))
    yellow, blue = hues(image, YELLOW), hues(image, BLUE)
    assert 300 < yellow[0] < 8000
    assert 300 < blue[0] < 8000
    assert yellow[1] < 320 < blue[1] or name == "left-curve"
    floor, sky = image[300:, :, :3].astype(float), image[:200, :, :3]
    assert floor[..., 0].std() > 3
    assert np.ptp(sky.reshape(-1, 3), axis=0).max() == 0


@pytest.mark.parametrize("name", TRACKS)
def test_cones_are_seen_all_along_the_lane(name):
    """Halfway between each pair of cones, looking along the lane, both colours show until past the finish."""
    renderer = Renderer(load_scene(MAPS / name), 320, 240, math.radians(48.8))
    yellow, blue = cones(name, "yellow"), cones(name, "blue")
    nearest = blue[np.linalg.norm(yellow[:, None] - blue[None], axis=2).argmin(axis=1)]
    middle = (yellow + nearest) / 2
    finish = {"left-curve": 4, "kiwi-track": 1}.get(name, 5)
    for here, there in pairwise(middle[: -finish + 1]):
        yaw = math.atan2(there[1] - here[1], there[0] - here[0])
        image = renderer.render(CameraPose.at(here[0], here[1], 0.095, yaw=yaw))
        assert hues(image, YELLOW)[0] > 20
        assert hues(image, BLUE)[0] > 20


def test_two_cars_are_on_the_straight_track():
    """The car is as long and as wide as the one that is judged, and points along -y."""
    ours, straight = (json.loads((MAPS / name / "map.json").read_text()) for name in ("two-cars", "straight"))
    car = ours["model"].pop()
    assert ours == straight
    assert (car["name"], car["frames"]) == ("kiwi", [0, 1])
    shape = load_scene(MAPS / "two-cars").models[-1].shape
    assert np.ptp(shape.vertices, axis=0) == pytest.approx([0.16, 0.36, 0.11])
    top = shape.vertices[shape.vertices[:, 2] > 0.1]
    assert abs(top[:, 1].min()) < abs(top[:, 1].max())
