import json
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

from dodo_dsl.opendlv.envelope import Envelope
from tests.rec.conftest import BEGIN, HEIGHT, WIDTH, dodo_rec, message, pictures, video

PREFIX = "opendlv.logic.perception.Detection"


def cone(time: int, number: int, label: str, x: float, sender_stamp: int = 0) -> list[Envelope]:
    key = {"detectionId": number}
    box = {"x": x, "y": 0.5, "width": 0.125, "height": 0.25}
    return [
        message(PREFIX + "Type", time, sender_stamp, type=4, **key),
        *([message(PREFIX + "Property", time, sender_stamp, property=label, **key)] if label else []),
        message(PREFIX + "BoundingBox", time, sender_stamp, **key, **box),
    ]


@pytest.fixture
def drive(record: Callable[..., Path]) -> Path:
    envelopes = [
        *video(12),
        *cone(BEGIN + 700_000, 0, "yellow", 0.25),
        *cone(BEGIN + 700_000, 1, " color:blue ", 0.5),
        *cone(BEGIN + 1_000_000, 0, "", 0.0, 3),
        *cone(BEGIN + 50_000, 0, "yellow", 0.75),
        *cone(BEGIN + 700_000, 1, "red", 0.25),
        message(PREFIX + "Property", BEGIN, property="boxless"),
        message(PREFIX + "BoundingBox", BEGIN, x=float("nan")),
    ]
    return record(envelopes)


def test_frames_with_detections(drive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    assert dodo_rec("export", drive, "--coco", "-o", folder) == (0, f"{folder}: 2 frames with 3 boxes\n", "")
    found = json.loads((folder / "annotations.json").read_text())
    names = {category["id"]: category["name"] for category in found["categories"]}
    assert [(a["image_id"], names[a["category_id"]], a["bbox"], a["area"]) for a in found["annotations"]] == [
        (1, "yellow", [16.0, 24.0, 8.0, 12.0], 96.0),
        (1, "blue", [32.0, 24.0, 8.0, 12.0], 96.0),
        (2, "type 4", [0.0, 24.0, 8.0, 12.0], 96.0),
    ]
    assert [image["sample_time"] for image in found["images"]] == [BEGIN + 700_000, BEGIN + 1_000_000]
    for image, picture in zip(found["images"], (pictures(12)[7], pictures(12)[10]), strict=True):
        written = cv2.imread(str(folder / image["file_name"]))
        assert written.shape == (image["height"], image["width"], 3) == (HEIGHT, WIDTH, 3)
        assert abs(written.astype(int) - picture).max() <= 6
    assert {len({a["id"] for a in found["annotations"]}), len(names)} == {3}


def test_frames_as_jpeg_with_the_labels_of_a_sender(drive: Path, tmp_path: Path) -> None:
    words = ["--pictures", "jpg", "--start", "0.45", "--labels", "3"]
    answer = dodo_rec("export", drive, "--coco", "-o", tmp_path / "set", *words)
    assert answer.stdout.endswith("1 frames with 1 boxes\n")
    assert len(list((tmp_path / "set" / "images").glob("0-*.jpg"))) == 1


def test_boxes_are_cut_at_the_edges_of_their_frame(record: Callable[..., Path], tmp_path: Path) -> None:
    """WIDTH x HEIGHT are 64 x 48."""
    boxes = [(-0.25, 0.5, 0.5, 0.25), (0.875, 0.75, 1, 1), (0.5, 0.5, 0, 0), (0.5, 0.5, -0.5, 0.25), (2, 2, 1, 1)]
    fields = [dict(zip(("x", "y", "width", "height"), box, strict=True)) for box in [*boxes, (0.1, 0, 0.9, 1)]]
    found = [message(PREFIX + "BoundingBox", BEGIN, detectionId=n, **each) for n, each in enumerate(fields)]
    answer = dodo_rec("export", record([*video(2), *found]), "--coco", "-o", tmp_path / "set")
    told = ["cut 2 boxes at the edges of their frames", "left out 3 boxes without an area in their frames"]
    assert (answer.code, answer.stderr.splitlines()) == (0, [f"dodo rec: {text}" for text in told])
    written = json.loads((tmp_path / "set" / "annotations.json").read_text())["annotations"]
    assert [each["bbox"] for each in written] == [[0, 24, 16, 12], [56, 36, 8, 12], [6.4, 0, 57.6, 48]]
    empty = dodo_rec("export", record([*video(2), *found[2:5]]), "--coco", "-o", tmp_path / "empty")
    assert empty.code == 2 and "has a detection with a box in it" in empty.stderr


def test_classes_have_their_numbers_in_every_set(record: Callable[..., Path], tmp_path: Path) -> None:
    labels = ("blue", "yellow", "ball")
    path = record([*video(2), *(e for n, each in enumerate(labels) for e in cone(BEGIN, n, each, 0.25))])
    assert dodo_rec("export", path, "--coco", "-o", tmp_path / "set").code == 0
    found = json.loads((tmp_path / "set/annotations.json").read_text())["categories"]
    assert {each["name"]: each["id"] for each in found} == {"ball": 1949452379, "blue": 1, "yellow": 2}


def test_frames_without_a_key_frame_are_told(record: Callable[..., Path], tmp_path: Path) -> None:
    path = record([*video(12)[2:], *cone(BEGIN + 700_000, 0, "yellow", 0.25)])
    answer = dodo_rec("export", path, "--coco", "-o", tmp_path / "set")
    told = "dodo rec: 3 packets come before the first key frame, and so cannot be decoded\n"
    assert (answer.code, answer.stderr) == (0, f"{told}dodo rec: 3 packets cannot be decoded\n")


NOTHING = "no frame of {path} that can be decoded has a detection with a box in it"


@pytest.mark.parametrize(
    ("envelopes", "words", "text"),
    [
        (cone(BEGIN, 0, "", 0.0), [], "the selection of {path} holds no camera frames (opendlv.proxy.ImageReading)"),
        (video(3), [], NOTHING),
        (video(3), ["--camera", "2"], "{path} holds no frames of camera 2, expected one of 0"),
        ([*video(2), *video(2, 5, 1)], [], "{path} holds frames of the cameras 0, 1; choose one with --camera"),
        (video(3), ["--message", "1055"], "--message does not apply to --coco; choose a sender with --camera"),
        ([*video(3), *cone(5, 0, "", 0.0)], [], NOTHING),
    ],
)
def test_what_cannot_be_exported(
    envelopes: list[Envelope], words: list[str], text: str, record: Callable[..., Path], tmp_path: Path
) -> None:
    path = record(envelopes)
    answer = dodo_rec("export", path, "--coco", "-o", tmp_path / "set", *words)
    assert answer == (2, "", f"dodo rec: {text.format(path=path)}\n")
    assert [entry.name for entry in tmp_path.iterdir()] == ["drive.rec"]


def test_what_is_there_is_kept(drive: Path, tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "annotations.json").write_text("{}")
    assert "annotations.json' exists already" in dodo_rec("export", drive, "--coco", "-o", tmp_path / "set").stderr
    assert (tmp_path / "set" / "annotations.json").read_text() == "{}"
    assert dodo_rec("export", drive, "--coco", "-o", tmp_path / "set", "--force").code == 0


def test_sets_of_several_recordings_have_one_numbering(record: Callable[..., Path], tmp_path: Path) -> None:
    """A drive on which only yellow cones were seen has the other classes, too."""
    drives = [
        record([*video(2), *cone(BEGIN, 0, "yellow", 0.25), *(cone(BEGIN, 1, "ball", 0.5) if n else [])], f"{n}.rec")
        for n in range(4)
    ]
    words = ("--coco", "--validation", "50%", "--seed", "1")
    assert dodo_rec("export", *drives, *words, "-o", tmp_path / "set").code == 0
    sets = [json.loads((tmp_path / "set" / part / "annotations.json").read_text()) for part in ("train", "validation")]
    assert sets[0]["categories"] == sets[1]["categories"] and len(sets[0]["categories"]) == 2
    of = [{image["recording"] for image in each["images"]} for each in sets]
    assert [len(each) for each in of] == [2, 2] and not of[0] & of[1]
    for part, each in zip(("train", "validation"), sets, strict=True):
        assert all((tmp_path / "set" / part / image["file_name"]).is_file() for image in each["images"])
    alone = dodo_rec("export", drives[0], *words, "-o", tmp_path / "alone")
    assert alone.code == 2 and "needs two recordings" in alone.stderr


@pytest.mark.parametrize("change", [{}, {"image_id": 9}, {"iscrowd": 1}])
def test_boxes_of_a_truth_file(change: dict[str, int], record: Callable[..., Path], tmp_path: Path) -> None:
    truth = {
        "images": [{"id": 7, "file_name": "a.png", "width": WIDTH, "height": HEIGHT}],
        "annotations": [{"id": 1, "image_id": 7, "category_id": 3, "bbox": [8, 8, 16, 12], **change}],
        "categories": [{"id": 3, "name": "ball"}],
    }
    (tmp_path / "truth.json").write_text(json.dumps(truth))
    words = ("--coco", "-o", tmp_path / "set", "--truth", tmp_path / "truth.json")
    answer = dodo_rec("export", record(video(2)), *words)
    if change:
        assert answer.code == 2 and "truth.json" in answer.stderr and not (tmp_path / "set").exists()
    else:
        found = json.loads((tmp_path / "set" / "annotations.json").read_text())
        assert [each["bbox"] for each in found["annotations"]] == [[8, 8, 16, 12]] * 2
