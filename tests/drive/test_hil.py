"""The hil tests on the emulated rig: the firmware's binary, the gantry, a camera at the rig's true place."""

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from services.gantry.rig_table import BOUNDS, MICROSTEP
from tests.drive.applications import KIWI, ROOT, dodo, kiwi, results
from tests.drive.variants import registry, variant

LABELLED = """
record: {frames: 2 Hz}
environment:
  camera: {uses: camera, with: {scene.truth-sender: 9, scene.truth-classes: [cone_yellow=yellow, cone_blue=blue]}}
evaluation:
  cones: {uses: object-detection, with: {min-frames: 20, max-time: 4 s}}
"""


def boxes(path: Path) -> dict[int, list[tuple[str, float, float, float, float]]]:
    """The boxes of a COCO file, by image."""
    found = json.loads(path.read_text())
    names = {category["id"]: category["name"] for category in found["categories"]}
    images: dict[int, Any] = {image["id"]: [] for image in found["images"]}
    for each in found["annotations"]:
        images[each["image_id"]].append((names[each["category_id"]], *each["bbox"]))
    return images


TRUTH = boxes(ROOT / "tests_registry" / "truths" / "static-rig.json")[1]
MICROSTEPS = tuple(1.01 * step for step in MICROSTEP.values())
"""m, m, rad; a Frame holds 32 bits a number."""
MEASURED, TRUE = 0, 1


pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("firmware")]


def run(report: Path, *words: str, code: int | tuple[int, ...]) -> dict[str, Any]:
    """The one test's result. A machine that is too busy for a rig that has to pass gets two more tries."""
    retries = () if code else ("--retry-errors", "2")
    dodo("run", *words, *retries, "--report", str(report), code=code)
    (test,) = results(report).values()
    return test


def poses(recording: Path, sender: int) -> NDArray[np.float64]:
    """Time in s, x and y in m, yaw in rad of each Frame of a sender."""
    messages, rows = MessageSet.standard(), []
    for envelope in read_envelopes(recording):
        if (envelope.data_type, envelope.sender_stamp) == (messages.id("opendlv.sim.Frame"), sender):
            frame: Any = messages.decode(envelope.data_type, envelope.payload)
            rows.append((envelope.sample_time / 1e6, frame.x, frame.y, 2 * math.atan2(frame.qz, frame.qw)))
    return np.array(rows)


def same_at_rest(measured: NDArray[np.float64], true: NDArray[np.float64]) -> None:
    """A pose is measured to within one microstep."""
    assert all(abs(m - t) <= step for m, t, step in zip(measured[1:], true[1:], MICROSTEPS, strict=True))


def test_the_emulated_rig_reaches_the_goal_within_its_limits(tmp_path: Path) -> None:
    test = run(tmp_path, "hil-dynamic", code=0)
    assert (test["outcome"], test["level"]) == ("passed", "hil")
    recording = tmp_path / "hil-dynamic" / "test.rec"
    measured, true = poses(recording, MEASURED), poses(recording, TRUE)
    assert len(measured) > 40
    assert len(true) > 200
    same_at_rest(measured[0], true[0])
    seen = np.stack([np.interp(measured[:, 0], true[:, 0], true[:, column]) for column in (1, 2, 3)], axis=1)
    assert np.abs(measured[:, 1:] - seen)[:, :2].max() < 0.02  # one message is up to 30 ms older than the other
    assert np.hypot(*np.gradient(true[::10, 1:3], true[::10, 0], axis=0).T).max() < 1
    for column, (low, high) in enumerate(BOUNDS.values(), start=1):
        assert low <= true[:, column].min() and true[:, column].max() <= high


@pytest.mark.parametrize("laps", [1, pytest.param(2, marks=pytest.mark.proof)])
def test_laps_on_the_rig_that_turns_without_end(tmp_path: Path, laps: int) -> None:
    """A turn of the yaw each, past its index, after which it still knows its heading."""
    gates = ["far", "finish", "far"][: 2 * laps - 1]
    keys = {"evaluation": {"track": {"with": {"gates": gates}}}}
    spec = variant(registry(tmp_path), "hil-closed-oval", "hil-laps", **keys)
    application = str(KIWI / "docker-compose.yml")
    test = run(tmp_path / "report", str(spec), "--application", application, code=0)
    checks = {check["name"]: check["value"] for check in test["checks"]}
    assert (test["outcome"], checks["gates"]) == ("passed", len(gates))
    past_finish = 0.25  # m, where it starts
    assert checks["distance"] == pytest.approx(laps * (2 * math.pi * 0.6 + 0.9) - past_finish, rel=0.1)
    recording = tmp_path / "report" / "hil-laps" / "test.rec"
    measured, true = poses(recording, MEASURED), poses(recording, TRUE)
    same_at_rest(measured[0], true[0])
    turned = np.unwrap(true[:, 3])
    assert turned[-1] - turned[0] == pytest.approx(2 * math.pi * laps, abs=0.7)
    assert np.abs(np.diff(turned)).max() < 0.1, "it never turned back around"
    seen = np.interp(measured[:, 0], true[:, 0], turned)
    assert np.abs(np.unwrap(measured[:, 3]) - seen).max() < 0.05
    assert np.abs(true[:, 1]).max() < 0.95 and np.abs(true[:, 2]).max() < 0.7


@pytest.mark.parametrize("steering", ["--reverse", pytest.param("", marks=pytest.mark.proof)], ids=["wrong", "right"])
def test_the_rig_goes_its_way_whatever_the_application_does(tmp_path: Path, steering: str) -> None:
    """On a busy machine the reversed application is not judged, but the reason says what was found."""
    application = str(kiwi(tmp_path / "app", None, steering=steering))
    words = ("hil-open-straight", "--application", application)
    test = run(tmp_path / "report", *words, code=(1, 3) if steering else 0)
    expected = "passed" if not steering else "error" if test["machine"]["undecided"] else "failed"
    assert (test["outcome"], test["kind"]) == (expected, "open-loop"), test
    assert "the mean distance is " in test["reason"] or not steering
    recording = tmp_path / "report" / "hil-open-straight" / "test.rec"
    measured, true = poses(recording, MEASURED), poses(recording, TRUE)
    same_at_rest(measured[0], true[0])
    same_at_rest(measured[-1], true[-1])
    way = np.loadtxt(ROOT / "tests_registry" / "targets" / "rig-straight.csv", delimiter=",", skiprows=1)
    assert np.abs(true[[0, -1], 1:3] - way[[0, -1], 1:3]).max() < 0.02


def shows_its_board(report: Path) -> None:
    """The snapshot of the camera shows what is there, and the reports lead to it."""
    assert 'src="hil-labelled/snapshot.png"' in (report / "index.html").read_text()
    assert "hil-labelled/snapshot.png]]" in (report / "junit.xml").read_text()
    snapshot = cv2.imread(str(report / "hil-labelled" / "snapshot.png"))
    assert snapshot.shape == (480, 640, 3)
    for label, x, y, width, height in TRUTH:
        blue, _, red = snapshot[round(y + 0.8 * height), round(x + width / 2)].tolist()
        assert (blue - red > 20) if label == "blue" else (red - blue > 80), (label, x, y)


def test_the_static_rig_sees_its_board_and_its_recording_is_a_labelled_data_set(tmp_path: Path) -> None:
    spec = variant(registry(tmp_path), "hil-camera", "hil-labelled", **yaml.safe_load(LABELLED))
    run(tmp_path / "report", str(spec), "--application", str(KIWI / "docker-compose.yml"), code=0)
    shows_its_board(tmp_path / "report")
    recording = tmp_path / "report" / "hil-labelled" / "test.rec"
    for sender in ("0", "9"):
        folder = tmp_path / "set" / sender
        dodo("rec", "export", str(recording), "--coco", "-o", str(folder), "--labels", sender, code=0)
        is_labelled(folder, 10 if sender == "0" else 1)


def is_labelled(folder: Path, within: float) -> None:
    """Every picture of a set has a box at each cone, to within some pixels."""
    images = boxes(folder / "annotations.json")
    assert len(images) >= 5
    assert len(list((folder / "images").glob("*.png"))) == len(images)
    for found in images.values():
        assert sorted(label for label, *_ in found) == sorted(label for label, *_ in TRUTH)
        for label, *true in TRUTH:
            nearest = min((box for name, *box in found if name == label), key=lambda box: math.dist(box[:2], true[:2]))
            assert nearest == pytest.approx(true, abs=within), (label, true)


def test_what_moves_with_the_rig_is_found(tmp_path: Path) -> None:
    """Whether the application keeps up on a busy machine says nothing of it."""
    test = run(tmp_path, "hil-perception", code=(0, 3))
    assert test["outcome"] == "passed" or test["machine"]["undecided"], test["reason"]
