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
    assert said.startswith("board.json: 8 boxes (4 blue, 4 yellow) in 640 x 480 pixels")
    shipped = boxes(place / "tests" / "truths" / "static-rig.json")
    for (label, box), (true_label, true) in zip(boxes(place / "board.json"), shipped, strict=True):
        assert label == true_label
        assert box == pytest.approx(true, abs=0.1)
    assert load_truth(place / "board.json", "one").labels() == ["blue", "yellow"]
    picture, marked = (cv2.imread(str(place / name)) for name in ("board.png", "board-boxes.png"))
    assert picture.shape == (480, 640, 3)
    changed = (marked[::2, ::2] != picture).any(axis=2)
    assert 1000 < changed.sum() < 10_000, "boxes and names, and the picture below them"
    for _, (x, y, width, height) in shipped:
        inside = changed[round(y) + 3 : round(y + height) - 3, round(x) + 3 : round(x + width) - 3]
        assert inside.mean() < 0.3, "the object can be seen"
        assert changed[round(y) : round(y) + 2, round(x) + 5 : round(x + width) - 5].any(axis=0).all()


@pytest.mark.realtime
def test_boxes_marked_by_hand_on_a_snapshot(place: Path) -> None:
    assert "desk-1.png: a snapshot of 320 x 240 pixels; mark boxes with" in rig("desk", "-o", "desk-1.json")
    assert files(place, "desk-1") == ["desk-1.png"]
    before = (place / "desk-1.png").read_bytes()
    words = ("--picture", "desk-1.png", "--box", "color:yellow", 40, 0, 40, 40.5, "--box", "blue", 280, 200, 40, 40)
    rig("desk", "-o", "desk-1.json", *words)
    assert boxes(place / "desk-1.json") == [("yellow", [40, 0, 40, 40.5]), ("blue", [280, 200, 40, 40])]
    assert files(place, "desk-1") == ["desk-1-boxes.png", "desk-1.json", "desk-1.png"]
    assert (place / "desk-1.png").read_bytes() == before
    assert "'desk-1.json' exists already; --force replaces it" in rig("desk", "-o", "desk-1.json", *words, code=2)


BOX = ("--box", "yellow", 10, 20, 30, 40)
DESK = ("desk", "--picture", "desk.png")
"""Without a snapshot, which takes a second."""


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((*DESK, "--box", "yellow", 300, 20, 30, 40), "lies outside the frame of 320 x 240 pixels"),
        ((*DESK, *BOX, "--classes", "red,blue"), "there is no class 'yellow', expected one of red, blue"),
        ((*DESK, "--box", "red", 1, 2, 3, 4, "--test", "hil-camera"), "no class 'red', expected one of blue, yellow"),
        (("desk", *BOX, "--picture", "none.png"), "none.png: cannot be read: No such file"),
        (("desk", *BOX, "--picture", "dodo.yml"), "dodo.yml: not a readable image"),
        (("desk", *BOX, "-o", "desk-2.txt"), "expected a file that ends in .json"),
        (("desk", *BOX, "--test", "sil-open-straight"), "has no service 'camera'"),
        (("blind", *BOX), "rig 'blind' has no camera in dodo.yml"),
        (
            ("nobody", *BOX),
            "unknown rig 'nobody', expected one of emulated, emulated-circle, blind, desk, kiwi-static",
        ),
        (("emulated",), "the emulated rig's camera sees the map of a test: name one with --test"),
        (("emulated", "--test", "hil-camera-scenes"), "matches 6 tests, expected one"),
        pytest.param(
            *(("emulated", "--test", "hil-camera"), "the test judges blue, yellow: write --classes cone_yellow=CLASS"),
            marks=pytest.mark.realtime,
        ),
        pytest.param(
            *(
                ("emulated", "--test", "hil-camera", "--classes", "cone_red=red"),
                "there is no model 'cone_red' in the map",
            ),
            marks=pytest.mark.realtime,
        ),
        (("emulated", "--picture", "desk.png"), "--picture has no virtual scene"),
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
    assert files(place / "truths", "") == [
        f"{n}{end}" for n in ("board", "desk") for end in ("-boxes.png", ".json", ".png")
    ]
    shown = re.findall(r"dodo rig truth (.*)", EXAMPLES.replace("\\\n", " "))
    assert len(shown) == 3
    for words in shown:
        rig(*shlex.split(words), *([] if "--force" in words else ["--force"]))


@pytest.mark.realtime
def test_a_dark_picture_is_taken_with_a_warning(place: Path) -> None:
    cv2.imwrite("desk.png", np.kron(np.eye(8), np.ones((40, 40))).astype(np.uint8))
    said = rig("desk", "-o", "dusk.json", *BOX)
    assert "warning: the camera's picture has a brightness of" in said and "is it lit?" in said
    assert "dusk.json: 1 box (1 yellow)" in said
