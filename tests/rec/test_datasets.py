"""Data sets joined from several recordings, with a part for validation."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.rec.steering import SplitError, split_recordings
from tests.rec.conftest import BEGIN, HEIGHT, WIDTH, dodo_rec, message, pictures, video

PREFIX = "opendlv.logic.perception.Detection"
STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"


def cone(time: int, label: str) -> list[Envelope]:
    return [
        message(PREFIX + "Property", time, property=label),
        message(PREFIX + "BoundingBox", time, x=0.5, y=0.5, width=0.1, height=0.2),
    ]


@pytest.fixture
def drives(record: Callable[..., Path]) -> list[Path]:
    """Five recordings with as many boxes as their number, of other classes from one to the next."""
    return [
        record(
            [
                *video(6),
                *(e for n in range(number) for e in cone(BEGIN + n * 100_000, "yellow" if number % 2 else "blue")),
            ],
            f"drive-{number}.rec",
        )
        for number in range(1, 6)
    ]


def annotations(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "annotations.json").read_text()))


def test_recordings_become_one_set_with_ids_of_its_own(drives: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "set"
    answer = dodo_rec("export", *drives, "--coco", "-o", folder)
    assert answer == (0, f"{folder}: 15 frames with 15 boxes of 5 recordings\n", "")
    found = annotations(folder)
    assert [image["id"] for image in found["images"]] == [a["id"] for a in found["annotations"]] == list(range(1, 16))
    assert {a["image_id"] for a in found["annotations"]} == set(range(1, 16))
    assert [category["name"] for category in found["categories"]] == ["blue", "yellow"]
    assert [image["recording"] for image in found["images"][:3]] == [str(drives[0]), str(drives[1]), str(drives[1])]
    names = [image["file_name"] for image in found["images"]]
    assert len(set(names)) == 15 and all((folder / name).is_file() for name in names)
    yellow = {c["id"]: c["name"] for c in found["categories"]}
    assert [yellow[a["category_id"]] for a in found["annotations"]].count("yellow") == 1 + 3 + 5


@pytest.mark.thorough
def test_validation_has_recordings_of_its_own(drives: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "set"
    words = ("export", *drives, "--coco", "--validation", "40%", "-o")
    assert dodo_rec(*words, folder).code == 0
    parts = {name: annotations(folder / name) for name in ("train", "validation")}
    of = {name: {image["recording"] for image in part["images"]} for name, part in parts.items()}
    assert (len(of["train"]), len(of["validation"])) == (3, 2) and not of["train"] & of["validation"]
    assert sum(len(part["annotations"]) for part in parts.values()) == 15
    assert dodo_rec(*words, tmp_path / "again").code == 0
    assert annotations(tmp_path / "again" / "train") == parts["train"], "the same split again"
    others = set()
    for seed in range(1, 5):
        dodo_rec(*words, tmp_path / f"other-{seed}", "--seed", str(seed))
        others.add(str(annotations(tmp_path / f"other-{seed}" / "validation")["images"]))
    assert len(others) > 1


def test_frames_with_the_requests_that_answered_them(record: Callable[..., Path], tmp_path: Path) -> None:
    drive = record(
        [
            *video(6),
            message(STEERING, BEGIN, groundSteering=0.25),
            message(PEDAL, BEGIN, position=0.125),
            message(STEERING, BEGIN + 150_000, groundSteering=-0.5),
            message(STEERING, BEGIN + 160_000, groundSteering=float("nan")),
        ]
    )
    folder = tmp_path / "pairs"
    code, out, err = dodo_rec("export", drive, "--steering", "-o", folder)
    assert (code, out) == (0, f"{folder}: 2 frames with steering\n")
    assert "left out 4 frames without a GroundSteeringRequest within 0.2 s" in err
    with (folder / "steering.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["sample_time_us"], row["ground_steering_rad"], row["pedal"]) for row in rows] == [
        (str(BEGIN), "0.25", "0.125"),
        (str(BEGIN + 100_000), "-0.5", ""),
    ]
    for row, picture in zip(rows, pictures(2), strict=True):
        written = cv2.imread(str(folder / row["picture"]))
        assert written.shape == (HEIGHT, WIDTH, 3) and abs(written.astype(int) - picture).max() <= 6


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--coco",), "name the folder of the data set with -o"),
        (("--csv", "-o", "tables"), "--csv takes one recording; only --coco and --steering join several"),
        (("--steering", "-o", "pairs"), "no frame of 5 recordings that can be decoded has a GroundSteeringRequest"),
        (("--coco", "-o", "drive-1.rec"), "'drive-1.rec' is not a folder"),
    ],
)
def test_what_cannot_be_joined(
    drives: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    answer = dodo_rec("export", *drives, *words)
    assert answer.code == 2 and answer.stderr.splitlines()[-1].startswith("dodo rec: ") and said in answer.stderr
    assert [path for path in sorted(tmp_path.iterdir()) if path not in before and any(path.rglob("*.*"))] == []


def test_one_recording_is_not_split(drives: list[Path], tmp_path: Path) -> None:
    answer = dodo_rec("export", drives[0], "--coco", "--validation", "0.5", "-o", tmp_path / "set")
    assert answer.code == 2 and "needs two recordings or more" in answer.stderr


@given(st.integers(2, 50), st.floats(0.01, 0.99), st.integers(0, 5))
def test_both_parts_have_recordings_and_each_is_in_one(number: int, share: float, seed: int) -> None:
    files = [Path(str(one)) for one in range(number)]
    parts = split_recordings(files, share, seed)
    assert sorted((*parts["train"], *parts["validation"])) == sorted(files)
    assert parts["train"] and parts["validation"]
    assert abs(len(parts["validation"]) - share * number) <= 1


def test_a_single_recording_cannot_be_split() -> None:
    with pytest.raises(SplitError):
        split_recordings([Path("a")], 0.5, 0)
