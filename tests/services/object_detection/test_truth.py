import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.assets.problem import InputError
from services.object_detection.boxes import Box, FrameKey, LabelledBox, load_truth

COCO = {
    "images": [
        {"id": 4, "width": 640, "height": 480, "sample_time": 1_000_000},
        {"id": 5, "width": 320, "height": 240, "sample_time": 1_100_000},
    ],
    "categories": [{"id": 1, "name": "color:yellow"}, {"id": 2, "name": "blue"}],
    "annotations": [
        {"id": 1, "image_id": 4, "category_id": 1, "bbox": [64, 48, 32, 24.0], "iscrowd": 0},
        {"id": 2, "image_id": 4, "category_id": 2, "bbox": [-10, 0, 20, 20]},
    ],
}
YELLOW = LabelledBox("yellow", Box(0.1, 0.1, 0.05, 0.05))


def write(folder: Path, document: Any) -> Path:
    path = folder / "truth.json"
    path.write_text(document if isinstance(document, str) else json.dumps(document), encoding="utf-8")
    return path


def single() -> dict[str, Any]:
    return {**copy.deepcopy(COCO), "images": [dict(COCO["images"][0])]}


def test_one_picture_holds_for_every_frame(tmp_path: Path) -> None:
    truth = load_truth(write(tmp_path, single()), "one")
    boxes = truth.of(FrameKey(1, 2))
    assert boxes is not None and boxes == truth.of(FrameKey(3, 4))
    assert boxes[0].label == "yellow" and boxes[0].box == pytest.approx(YELLOW.box)
    assert truth.labels() == ["blue", "yellow"]


def test_pictures_by_sample_time_and_by_number(tmp_path: Path) -> None:
    path = write(tmp_path, COCO)
    by_time, by_number = load_truth(path, "sample-time"), load_truth(path, "number")
    assert [len(by_time.of(FrameKey(time, 4)) or "") for time in (1_000_000, 1_100_000)] == [2, 0]
    assert by_time.of(FrameKey(1_100_000, 9)) == () and by_time.of(FrameKey(1_000_001, 4)) is None
    assert by_number.of(FrameKey(1, 5)) == () and by_number.of(FrameKey(1_000_000, 6)) is None


def change(path: tuple[Any, ...], value: Any) -> Callable[[dict[str, Any]], None]:
    def apply(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return apply


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("images",), None, ": $.images: expected a list, found null"),
        (("annotations",), [], ": $.annotations: no boxes, expected at least one"),
        (("annotations", 0, "image_id"), 6, ": $.annotations[0].image_id: no entry has the id 6"),
        (("annotations", 1, "bbox"), [1, 2, 3, 10**400], ": $.annotations[1].bbox[3]: Number out of range"),
        (("annotations", 1, "bbox"), [1, 2, 3, 0], ": $.annotations[1].bbox: has no area, 3 x 0 pixels"),
        (("annotations", 1, "bbox"), [640, 2, 3, 3], ": $.annotations[1].bbox: lies outside its image of 640 x 480"),
        (("annotations", 1, "bbox"), [-3, 2, 3, 3], ": $.annotations[1].bbox: lies outside its image of 640 x 480"),
        (("annotations", 0, "iscrowd"), 1, ": $.annotations[0].bbox: iscrowd is set, expected the box of one object"),
        (("images", 0, "sample_time"), 1.5, ": $.images[0].sample_time: expected a whole number, found 1.5"),
        (("images", 1, "id"), 4, ": $.images: two have the same id"),
        (("images", 1, "sample_time"), 1_000_000, ": $.images: two have the same sample_time"),
    ],
)
def test_what_is_refused(tmp_path: Path, path: tuple[Any, ...], value: Any, said: str) -> None:
    document = copy.deepcopy(COCO)
    change(path, value)(document)
    file = write(tmp_path, document)
    with pytest.raises(InputError) as raised:
        load_truth(file, "sample-time")
    assert str(raised.value).startswith(f"{file}{said}")
