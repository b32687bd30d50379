"""Found and true boxes of frames."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.plan.model import Flag, Plan, PlannedService
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.report.viewer import boxes, recorded
from tests.report.viewer import failures
from tests.report.viewer.drives import EPOCH, GOLDEN, MESSAGES, MadeDrive, record

COCO: dict[str, Any] = {
    "images": [{"id": 4, "width": 640, "height": 480, "sample_time": EPOCH + 100_000}],
    "categories": [{"id": 1, "name": "color: blue"}],
    "annotations": [{"image_id": 4, "category_id": 1, "bbox": [64, 48, 320, 240]}],
}


def plan(**flags: str) -> Plan:
    named = tuple(Flag(name.replace("_", "-"), value) for name, value in flags.items())
    judge = PlannedService("evaluation", "cones", "object-detection", "x", (), named, judge=True)
    whole = from_json((GOLDEN / "sil-closed-straight" / "test.json").read_text())
    return replace(whole, services=(judge,))


def frames(folder: Path, tested: Plan) -> list[dict[str, Any]]:
    samples = [*failures.boxes(0.1, 0, [("blue", 0.5, 0.5)]), *failures.boxes(0.4, 9, [("yellow", 0.1, 0.2)])]
    samples += failures.boxes(0.1, 0, [("again", 0.6, 0.6)])
    record(folder / "test.rec", MadeDrive("x", 1.0, samples, {}))
    return boxes.frames(tested, folder, recorded.read(folder / "test.rec", MESSAGES))


def test_live_truth_has_frames_of_its_own(tmp_path: Path) -> None:
    assert frames(tmp_path, plan(sender="0", truth_sender="9")) == [
        {"time": 0.1, "found": [("blue", 0.5, 0.5, 0.1, 0.2)], "true": None},
        {"time": 0.4, "found": [], "true": [("yellow", 0.1, 0.2, 0.1, 0.2)]},
    ]


@pytest.mark.parametrize(("kind", "image"), [("one", {}), ("sample-time", {}), ("number", {"id": 1})])
def test_truth_of_a_file_is_found_as_its_flag_says(tmp_path: Path, kind: str, image: dict[str, int]) -> None:
    (tmp_path / "files").mkdir()
    number = image.get("id", 4)
    document = {**COCO, "images": [{**COCO["images"][0], **image}]}
    document["annotations"] = [{**COCO["annotations"][0], "image_id": number}]
    (tmp_path / "files" / "truth.json").write_text(json.dumps(document))
    (frame,) = frames(tmp_path, plan(sender="0", truth="truth.json", truth_frames=kind))
    assert frame["true"] == [("blue", 0.1, 0.1, 0.5, 0.5)]


def test_without_a_judge_of_detections_there_are_no_frames(tmp_path: Path) -> None:
    whole = from_json((GOLDEN / "sil-closed-straight" / "test.json").read_text())
    assert frames(tmp_path, whole) == []
