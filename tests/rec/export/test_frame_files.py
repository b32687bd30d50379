"""Frames as pictures: which files there are, and what is in them."""

from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

from tests.rec.conftest import BEGIN, dodo_rec, message, pictures, video

EARLY = "dodo rec: 1 packet comes before the first key frame, and so cannot be decoded\n"


def test_a_picture_for_each_frame(record: Callable[..., Path], tmp_path: Path) -> None:
    path, folder = record([*video(6), *video(2, sender_stamp=1)]), tmp_path / "pictures"
    answer = dodo_rec("export", path, "--frames", "-o", folder, "--camera", "0")
    assert answer == (0, f"{folder}: 6 frames\n", "")
    assert sorted(file.name for file in folder.iterdir()) == [f"0-{BEGIN + n * 100_000}.png" for n in range(6)]
    for number, picture in enumerate(pictures(6)):
        written = cv2.imread(str(folder / f"0-{BEGIN + number * 100_000}.png"))
        assert written.shape == picture.shape and abs(written.astype(int) - picture).max() <= 6


def test_a_part_as_jpeg_begins_with_a_key_frame(record: Callable[..., Path], tmp_path: Path) -> None:
    words = ["--pictures", "jpg", "--start", "0.35", "--end", "0.75"]
    answer = dodo_rec("export", record(video(12)), "--frames", "-o", tmp_path / "out", *words)
    assert (answer.code, answer.stderr) == (0, f"{EARLY}dodo rec: 1 packet cannot be decoded\n")
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [
        f"0-{BEGIN + n * 100_000}.jpg" for n in (5, 6, 7)
    ]


def test_frames_of_the_same_sample_time_are_all_kept(record: Callable[..., Path], tmp_path: Path) -> None:
    path = record([envelope._replace(sample_time=7) for envelope in video(3)])
    assert dodo_rec("export", path, "--frames", "-o", tmp_path / "out").code == 0
    written = [cv2.imread(str(tmp_path / "out" / f"0-7{end}.png"))[0, 0, 0] for end in ("", "-2", "-3")]
    assert written == sorted(set(written)), "each is brighter than the one before"


def test_only_files_that_would_be_replaced_are_in_the_way(record: Callable[..., Path], tmp_path: Path) -> None:
    path, folder = record(video(2)), tmp_path / "out"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / f"0-{BEGIN + 100_000}.png").write_text("mine")
    answer = dodo_rec("export", path, "--frames", "-o", folder)
    text = f"'{folder}/0-{BEGIN + 100_000}.png' exists already; --force replaces it"
    assert (answer.code, answer.stderr) == (2, f"dodo rec: {text}\n")
    assert len(list(folder.iterdir())) == 2
    assert dodo_rec("export", path, "--frames", "-o", folder, "--force").code == 0
    assert len(list(folder.iterdir())) == 3 and (folder / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), EARLY.removeprefix("dodo rec: ") + "dodo rec: no frame of {path} can be decoded"),
        (("--message", "1055"), "--message does not apply to --frames; choose a sender with --camera"),
        (("--camera", "3"), "{path} holds no frames of camera 3, expected one of 0"),
    ],
)
def test_what_cannot_be_exported(
    words: tuple[str, ...], text: str, record: Callable[..., Path], tmp_path: Path
) -> None:
    path = record([message("opendlv.proxy.ImageReading", BEGIN, data=b"x", format="h264")])
    answer = dodo_rec("export", path, "--frames", "-o", tmp_path / "out", *words)
    assert answer == (2, "", f"dodo rec: {text.format(path=path)}\n")
    assert [entry.name for entry in tmp_path.iterdir()] == ["drive.rec"]
