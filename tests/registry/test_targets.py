"""Targets and truths: as their generators make them, and fair to an application that does its work."""

import csv
import importlib.util
import json
import math
import sys
from types import ModuleType

import cv2
import numpy as np
import pytest
import yaml

from dodo_dsl import package_data
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene

REGISTRY = package_data.registry()
KIWI = package_data.root() / "examples" / "kiwi"


def program(path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


perception, steering = program(KIWI / "perception.py"), program(KIWI / "steering.py")


@pytest.mark.parametrize("folder", ["targets", "truths"])
def test_files_are_what_their_generator_makes(folder, tmp_path):
    program(REGISTRY / folder / f"make_{folder}.py").make(tmp_path)
    kept = {p.name: p.read_bytes() for p in (REGISTRY / folder).iterdir() if p.suffix in (".csv", ".json")}
    assert kept == {p.name: p.read_bytes() for p in tmp_path.iterdir()}


def rows(name: str) -> list[dict[str, float]]:
    with (REGISTRY / "targets" / f"{name}.csv").open() as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def renderer(name: str) -> Renderer:
    return Renderer(load_scene(REGISTRY / "maps" / name), 640, 480, math.radians(48.8))


def parameters(test: str, service: str) -> dict:
    return yaml.safe_load((REGISTRY / test / f"{test}.dodo.yml").read_text())["evaluation"][service]["with"]


def seen(image) -> dict[str, list]:
    """The cones of an image by colour, on the ground."""
    places = {"yellow": [], "blue": []}
    for cone in perception.find(image):
        places[cone.colour].append(steering.on_the_ground(cone.x, cone.y, cone.width, cone.height))
    return places


def within(signal, target, limits) -> list[str]:
    """The checks of continuous-signal that a signal meets (equations 4.6 to 4.9 of the thesis)."""
    d = np.abs(np.asarray(signal) - target)
    share = float(limits["min-share"].removesuffix(" %")) / 100
    met = {
        "mean": d.mean() <= limits["max-mean"],
        "std": d.std() <= limits["max-std"],
        "distance": d.max() <= limits["max-distance"],
        "share": (d <= limits["band"]).mean() >= share,
    }
    return [name for name, ok in met.items() if ok]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["straight", "left-curve"])
def test_the_example_application_is_within_the_limits_and_others_are_not(name):
    limits, way = parameters(f"sil-open-{name}", "signal"), rows(name)
    eye, driver = renderer(name), steering.Driver()
    target = np.array([row["groundSteering"] for row in way])
    signal = [
        driver.drive(**seen(eye.render(CameraPose.at(row["x"], row["y"], 0.095, yaw=row["yaw"]))))[0] for row in way
    ]
    assert within(signal, target, limits) == ["mean", "std", "distance", "share"]
    for wrong in (-np.array(signal), np.zeros(len(way)), np.full(len(way), 0.05)):
        assert {"mean", "share"} & set(within(wrong, target, limits)) == set()


def test_the_truth_holds_the_cones_of_the_picture():
    """Each true box is full of its colour where no other cone hides it, and no cone is outside of all."""
    truth = json.loads((REGISTRY / "truths" / "static-rig.json").read_text())
    image = renderer("static-rig").render(CameraPose.at(0, 0, 0.095))[..., :3]
    hue, saturation, value = cv2.split(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_BGR2HSV))
    names = {c["id"]: c["name"] for c in truth["categories"]}
    assert sorted(names[a["category_id"]] for a in truth["annotations"]) == ["blue"] * 4 + ["yellow"] * 4
    assert [i["id"] for i in truth["images"]] == [1]
    for colour, (low, high) in {"yellow": (20, 35), "blue": (105, 130)}.items():
        found = (hue >= low) & (hue <= high) & (saturation > 150) & (value > 40)
        outside = found.copy()
        for a in truth["annotations"]:
            if names[a["category_id"]] == colour:
                x, y, w, h = a["bbox"]
                area = np.s_[math.floor(y) : math.ceil(y + h), math.floor(x) : math.ceil(x + w)]
                assert found[area].mean() > 0.25
                outside[area] = False
        assert outside.sum() == 0
    boxes = [a["bbox"] for a in truth["annotations"]]
    assert any(x == 0 for x, *_ in boxes)
    assert any(overlap(a, b) > 100 for a in boxes for b in boxes if a is not b)


def overlap(one: list[float], two: list[float]) -> float:
    """The common area of two boxes in square pixels."""
    sides = [min(one[i] + one[i + 2], two[i] + two[i + 2]) - max(one[i], two[i]) for i in (0, 1)]
    return max(0.0, sides[0]) * max(0.0, sides[1])
