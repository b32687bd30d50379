"""The truth about what a rig's camera sees: of the virtual scene, and marked by hand on a picture."""

import json
import re
import shlex
import shutil
from io import StringIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from dodo_dsl.cli.main import main
from dodo_dsl.cli.rig_truth import EXAMPLES
from services.object_detection.boxes import load_truth
from tests.drive.applications import ROOT

CONES = "cone_yellow=yellow,cone_blue=blue"
SIZE = (320, 240)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A deployment with the static rig's tests and a rig whose camera shows a picture."""
    for name in ("maps", "truths", "hil-camera", "hil-camera-scenes", "sil-open-straight"):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / "tests" / name)
    board = np.kron(np.indices((6, 8)).sum(0) % 2 * 200, np.ones((40, 40))).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "desk.png"), board)
    camera = {"source": "desk.png", "width": SIZE[0], "height": SIZE[1]}
    rigs = {
        "desk": {"kind": "static", "cid": 126, "camera": camera},
        "blind": {"kind": "static", "cid": 127},
        "kiwi-static": {"kind": "static", "cid": 125, "camera": {**camera, "width": 640, "height": 480}},
    }
    (tmp_path / "dodo.yml").write_text(yaml.safe_dump({"dodo": 1, "registry": ["tests"], "rigs": rigs}))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return tmp_path


def rig(*words: object, code: int = 0) -> str:
    stdout, stderr = StringIO(), StringIO()
    assert main(["rig", "truth", *map(str, words)], stdout, stderr) == code, stdout.getvalue() + stderr.getvalue()
    return stdout.getvalue() + stderr.getvalue()


def boxes(path: Path) -> list[tuple[str, list[float]]]:
    found: dict[str, Any] = json.loads(path.read_text())
    names = {category["id"]: category["name"] for category in found["categories"]}
    return [(names[each["category_id"]], each["bbox"]) for each in found["annotations"]]


def files(place: Path, stem: str) -> list[str]:
    return sorted(path.name for path in place.iterdir() if stem in path.name)


@pytest.mark.realtime
def test_the_scene_knows_the_shipped_truth(place: Path) -> None:
    said = rig("emulated", "--test", "hil-camera", "--classes", CONES, "-o", "board.json")
    assert said.startswith("board.json: 8 boxes in 640 x 480 pixels")
    shipped = boxes(place / "tests" / "truths" / "static-rig.json")
    for (label, box), (true_label, true) in zip(boxes(place / "board.json"), shipped, strict=True):
        assert label == true_label
        assert box == pytest.approx(true, abs=0.1)
    assert load_truth(place / "board.json", "one").labels() == ["blue", "yellow"]
    assert cv2.imread(str(place / "board.png")).shape == (480, 640, 3)


@pytest.mark.realtime
def test_a_snapshot_of_a_rig(place: Path) -> None:
    assert "desk-1.png: a snapshot of 320 x 240 pixels; mark its objects" in rig("desk", "-o", "desk-1.json")
    assert files(place, "desk-1") == ["desk-1.png"]
    assert "'desk-1.png' exists already; --force replaces it" in rig("desk", "-o", "desk-1.json", code=2)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("desk", "-o", "desk-2.txt"), "expected a file that ends in .json"),
        (("desk", "--test", "sil-open-straight"), "has no service 'camera'"),
        (("blind",), "rig 'blind' has no camera in dodo.yml"),
        (("nobody",), "unknown rig 'nobody', expected one of emulated, emulated-circle, blind, desk, kiwi-static"),
        (("emulated",), "the emulated rig's camera sees the map of a test: name one with --test"),
        (("emulated", "--test", "hil-camera-scenes"), "matches 6 tests, expected one"),
        pytest.param(
            *(
                ("emulated", "--test", "hil-camera", "--classes", "cone_red=red"),
                "there is no model 'cone_red' in the map",
            ),
            marks=pytest.mark.realtime,
        ),
    ],
)
def test_what_is_not_a_truth(place: Path, words: tuple[object, ...], sentence: str) -> None:
    assert sentence in rig("-o", "desk-2.json", *words, code=2)
    assert files(place, "desk-2") == []


@pytest.mark.realtime
def test_what_help_and_page_show_works(place: Path) -> None:
    page = (ROOT / "docs" / "how-to" / "rigs.md").read_text()
    for words in re.findall(r"dodo rig truth ([^`\n]*)", page.split("## Truth files")[1]):
        rig(*shlex.split(words))
    assert files(place / "truths", "") == ["board.json", "board.png", "desk.png"]
    shown = re.findall(r"dodo rig truth (.*)", EXAMPLES)
    assert len(shown) == 2
    for words in shown:
        rig(*shlex.split(words), *([] if "--force" in words else ["--force"]))


@pytest.mark.realtime
def test_a_dark_picture_is_taken_with_a_warning(place: Path) -> None:
    cv2.imwrite("desk.png", np.kron(np.eye(8), np.ones((40, 40))).astype(np.uint8))
    said = rig("desk", "-o", "dusk.json")
    assert "warning: the camera's picture has a brightness of" in said and "is it lit?" in said
    assert "dusk.png: a snapshot of 320 x 240 pixels" in said
