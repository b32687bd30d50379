"""What is judged can be checked: recordings judged again, and evaluators against other people's programs."""

import io
import json
import math
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from dodo_dsl.cli.main import main
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.outcome import SAMPLE_TIMES, SLOW_ANSWERS
from tests.drive.applications import ROOT
from tests.drive.recordings import MESSAGES, Runs, judged, run

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("judged")]

REGISTRY = ROOT / "tests_registry"
STRAIGHT, CURVE, SIGNAL, DRIVER = "sil-closed-straight", "sil-closed-left-curve", "sil-open-straight", "dil-kiwi-track"
CONES, BOARD = "sil-perception--light-1--clutter-0", "dil-static-rig"
CARS = ("sil-closed-two-cars", "sil-perception-cars")
ALL = (
    STRAIGHT,
    CURVE,
    "sil-closed-kiwi-track",
    SIGNAL,
    "sil-open-left-curve",
    CONES,
    BOARD,
    DRIVER,
    *CARS,
    "sil-empty-pictures",
)
CLOSE = {"rel": 1e-9, "abs": 1e-9}
STEERING = "opendlv.proxy.GroundSteeringRequest"
BOX, PROPERTY = "opendlv.logic.perception.DetectionBoundingBox", "opendlv.logic.perception.DetectionProperty"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return run(tmp_path_factory.mktemp("judged"), *ALL)


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_the_example_passes_every_shipped_test(runs: Runs) -> None:
    """Closed and open loop, perception, and recordings."""
    names = {path.name for path in REGISTRY.glob("[sd]il-*")}
    assert {slug.partition("--")[0] for slug in runs.tests} == names
    assert sum(test["sim_s"] for test in runs.tests.values()) > 40
    for slug, test in runs.tests.items():
        assert (test["outcome"], test["clock"], test["checks"] != []) == ("passed", "lockstep", True), test
        assert runs.recording(slug).stat().st_size > 10_000
    assert runs.checks(BOARD)["true-positives"] > 300


def test_what_was_judged_over_time_is_the_same_in_a_report_of_its_own(runs: Runs, tmp_path: Path) -> None:
    recording, report = runs.recording(CONES), tmp_path / "again"
    judged(0, recording, "--spec", CONES, "--report", report)
    record = "logs/evaluation.cones.judged"
    assert (report / CONES / record).read_bytes() == (recording.parent / record).read_bytes()
    assert (report / CONES / "drive.html").is_file() and (report / "index.html").is_file()
    said = io.StringIO()
    assert main(["judge", str(recording), "--spec", CONES, "--report", str(report)], said, said) == 2
    assert f"'{report}' is there already, expected a new folder" in said.getvalue()


@pytest.mark.parametrize("slug", ALL)
def test_judged_again_it_is_the_same_bit_for_bit(runs: Runs, slug: str) -> None:
    test = dict(runs.tests[slug])
    test["checks"] = [check for check in test["checks"] if check["name"] not in (SLOW_ANSWERS, SAMPLE_TIMES)]
    again = judged(0, runs.recording(slug), "--spec", slug)
    for key in ("name", "outcome", "reason", "checks", "verdicts"):
        assert again[key] == test[key], key
    assert (again["notes"], again["clock"]) == ([], "lockstep")


def test_another_limit_gives_another_verdict(runs: Runs, tmp_path: Path) -> None:
    spec = changed(tmp_path, STRAIGHT, "max-time", "3 s")
    again = judged(1, runs.recording(STRAIGHT), "--spec", spec)
    assert again["reason"].startswith("did not reach finish within 3.00 s: the vehicle is at x = ")
    assert again["notes"] == [f"the run said passed: {runs.tests[STRAIGHT]['reason']}"]
    spec = changed(tmp_path, SIGNAL, "max-mean", "0.001")
    again = judged(1, runs.recording(SIGNAL), "--spec", spec)
    assert "the mean distance is " in again["reason"] and "(at most 0.001)" in again["reason"]
    assert [c["value"] for c in again["checks"]] == [c["value"] for c in runs.tests[SIGNAL]["checks"]]


def test_a_part_of_a_recording_has_no_verdict(runs: Runs, tmp_path: Path) -> None:
    part = tmp_path / "part.rec"
    part.write_bytes(runs.recording(STRAIGHT).read_bytes()[:100_000])
    again = judged(3, part, "--spec", STRAIGHT)
    assert again["reason"] == (
        f"the recording ends after {again['duration']:.1f} s, before evaluator 'track' gave a verdict"
    )
    assert 1.0 < again["duration"] < 5.0


def test_a_recording_of_another_test_is_told(runs: Runs) -> None:
    again = judged(3, runs.recording(STRAIGHT), "--spec", SIGNAL)
    assert f"the recording is of another test, {STRAIGHT}" in again["notes"]


def changed(folder: Path, name: str, parameter: str, value: str) -> Path:
    """A copy of a shipped test with another limit."""
    spec = folder / name / f"{name}.dodo.yml"
    spec.parent.mkdir()
    for common in ("maps", "targets"):
        shutil.copytree(REGISTRY / common, folder / common, dirs_exist_ok=True)
    text = (REGISTRY / name / f"{name}.dodo.yml").read_text()
    text, count = re.subn(rf"(?<={parameter}: )[^,}}\n]+", value, text)
    assert count == 1
    spec.write_text(text)
    return spec


# Against shapely


def rectangle(frame: Any, length: float = 0.36, width: float = 0.16) -> shapely.Polygon:
    """The vehicle's outline."""
    heading = math.atan2(
        2 * (frame.qw * frame.qz + frame.qx * frame.qy), frame.qw**2 + frame.qx**2 - frame.qy**2 - frame.qz**2
    )
    still = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    turned = shapely.affinity.rotate(still, heading, origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turned, frame.x, frame.y)


def lines(map_name: str, *names: str) -> shapely.MultiLineString:
    obstacles = json.loads((REGISTRY / "maps" / map_name / "map.json").read_text())["obstacles"]
    found = []
    for entry in obstacles:
        if entry["name"] in names:
            segments = entry["lines"] if isinstance(entry["lines"][0], list) else [entry["lines"]]
            found += [[(x1, y1), (x2, y2)] for x1, y1, x2, y2 in segments]
    return shapely.MultiLineString(found)


@pytest.mark.parametrize(("slug", "map_name"), [(STRAIGHT, "straight"), (CURVE, "left-curve")])
def test_a_drive_is_that_of_shapely(runs: Runs, slug: str, map_name: str) -> None:
    frames = runs.messages(slug, "opendlv.sim.Frame")
    finish, walls = lines(map_name, "finish"), lines(map_name, "left", "right", "behind", "beyond")
    margin, distance, time, last = math.inf, 0.0, 0.0, frames[0][2]
    for seconds, _, frame in frames[1:]:
        time = seconds
        area = rectangle(last).union(rectangle(frame)).convex_hull
        distance += math.hypot(frame.x - last.x, frame.y - last.y)
        margin, last = min(margin, area.distance(walls)), frame
        if area.intersects(finish):
            break
    checks, evidence = runs.checks(slug), runs.evidence(slug)
    assert checks["time-to-goal"] == pytest.approx(time, **CLOSE)
    assert checks["wall-margin"] == pytest.approx(margin, **CLOSE)
    assert checks["distance"] == pytest.approx(distance, **CLOSE)
    assert (evidence["time"], evidence["x"], evidence["y"]) == (time, last.x, last.y)
    closest = next(frame for seconds, _, frame in frames if seconds == evidence["closest-time"])
    assert (evidence["closest-x"], evidence["closest-y"]) == (closest.x, closest.y)


# Against numpy


def assert_is_signal(runs: Runs, slug: str, times: Any, values: Any, target: Any) -> None:
    """``times`` and ``target`` (rows of time and value) in us."""
    inside = (times >= target[0, 0]) & (times <= target[-1, 0])
    times, values = times[inside], values[inside]
    expected = np.interp(times - target[0, 0], target[:, 0] - target[0, 0], target[:, 1])
    distances = np.abs(values - expected)
    checks, evidence, worst = runs.checks(slug), runs.evidence(slug), int(distances.argmax())
    assert checks["samples"] == len(times) > 50
    assert checks["mean"] == pytest.approx(distances.mean(), **CLOSE)
    assert checks["std"] == pytest.approx(distances.std(), **CLOSE)
    assert checks["distance"] == pytest.approx(distances.max(), **CLOSE)
    assert evidence["value"] == pytest.approx(values[worst], **CLOSE)
    assert evidence["target"] == pytest.approx(expected[worst], **CLOSE)
    assert evidence["time"] == pytest.approx(times[worst] / 1e6, **CLOSE)


def steering(runs: Runs, slug: str, of: int = 0) -> Any:
    """Sample times since ``of`` in us, and values."""
    samples = runs.messages(slug, STEERING)
    return np.array([time - of for _, time, _ in samples]), np.array([m.groundSteering for _, _, m in samples])


def test_a_signal_is_that_of_numpy(runs: Runs) -> None:
    table = np.genfromtxt(REGISTRY / "targets" / "straight.csv", delimiter=",", names=True)
    target = np.column_stack([np.rint(table["time"] * 1e6), table["groundSteering"]])
    assert_is_signal(runs, SIGNAL, *steering(runs, SIGNAL, 1_700_000_000_000_000), target)


def test_a_signal_is_that_of_numpy_by_the_sample_times_of_a_recording(runs: Runs) -> None:
    recorded = list(read_envelopes(REGISTRY / "recordings" / "kiwi-track.rec"))
    start = min(envelope.sample_time for envelope in recorded)
    chosen = [e for e in recorded if (e.data_type, e.sender_stamp) == (MESSAGES.id(STEERING), 0)]
    values = [MESSAGES.decode(e.data_type, e.payload).groundSteering for e in chosen]  # type: ignore[attr-defined]
    target = np.column_stack([[e.sample_time - start for e in chosen], values])
    assert_is_signal(runs, DRIVER, *steering(runs, DRIVER, start), target)


# Against COCO's own evaluation


def boxes(runs: Runs, slug: str, sender: int) -> dict[tuple[int, str], list[list[float]]]:
    """Boxes by sample time and class."""
    labels = {
        (t, m.detectionId): m.property.removeprefix("color:") for _, t, m in runs.messages(slug, PROPERTY, sender)
    }
    found: dict[tuple[int, str], list[list[float]]] = {}
    for _, time, m in runs.messages(slug, BOX, sender):
        found.setdefault((time, labels[time, m.detectionId]), []).append([m.x, m.y, m.width, m.height])
    return found


def coco(times: list[int], true: dict[tuple[int, str], Any], found: dict[tuple[int, str], Any]) -> tuple[int, int, int]:
    """True positives, false positives and false negatives over all frames and both classes."""
    classes = {"yellow": 1, "blue": 2}
    truth, size = COCO(), {"width": 1, "height": 1}
    rows = [(time, name, box) for (time, name), each in true.items() for box in each]
    truth.dataset = {
        "images": [{"id": time, **size} for time in times],
        "categories": [{"id": number, "name": name} for name, number in classes.items()],
        "annotations": [
            {"id": n, "image_id": t, "category_id": classes[c], "bbox": b, "area": b[2] * b[3], "iscrowd": 0}
            for n, (t, c, b) in enumerate(rows, 1)
        ],
    }
    truth.createIndex()
    rows = [(time, name, box) for (time, name), each in found.items() for box in each if time in times]
    detections = truth.loadRes([
        {"image_id": t, "category_id": classes[c], "bbox": b, "score": 1.0} for t, c, b in rows if c in classes
    ])  # fmt: skip
    evaluation = COCOeval(truth, detections, "bbox")
    evaluation.params.iouThrs = np.array([0.5])
    evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0, 1e9]], ["all"]
    evaluation.evaluate()
    hits = sum(int((each["dtMatches"] > 0).sum()) for each in evaluation.evalImgs if each)
    return hits, len(detections.anns) - hits, len(truth.anns) - hits


def assert_is_coco(runs: Runs, slug: str, hits: int, false: int, missed: int) -> None:
    checks = runs.checks(slug)
    counted = (checks["true-positives"], checks["false-positives"], checks["false-negatives"])
    assert counted == (hits, false, missed)
    assert checks["precision"] == pytest.approx(hits / (hits + false), **CLOSE)
    assert checks["recall"] == pytest.approx(hits / (hits + missed), **CLOSE)
    assert checks["f1"] == pytest.approx(2 * hits / (2 * hits + false + missed), **CLOSE)


def test_detections_are_those_of_coco(runs: Runs) -> None:
    true, found = boxes(runs, CONES, 9), boxes(runs, CONES, 0)
    times = sorted({time for time, _ in true})
    assert len(times) >= runs.checks(CONES)["frames"] > 50
    times = times[: int(runs.checks(CONES)["frames"])]
    true = {key: each for key, each in true.items() if key[0] in times}
    hits, false, missed = coco(times, true, found)
    assert_is_coco(runs, CONES, hits, false, missed)
    evidence = runs.evidence(CONES)
    worst = int(evidence["sample-time"])
    one = coco([worst], {key: each for key, each in true.items() if key[0] == worst}, found)
    assert one == (evidence["found"], evidence["false"], evidence["missed"])
    assert evidence["time"] == (worst - 1_700_000_000_000_000) / 1e6
