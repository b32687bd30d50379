"""The frames of a recording as videos."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from dodo_dsl.report.viewer import pictures, recorded
from dodo_dsl.report.viewer.pictures import Video
from tests.report.viewer import failures
from tests.report.viewer.drives import MESSAGES, MadeDrive, Sample, record


def written(folder: Path, samples: Sequence[Sample]) -> list[Any]:
    record(folder / "test.rec", MadeDrive("x", 1.5, samples, {}))
    test = recorded.read(folder / "test.rec", MESSAGES)
    return list(pictures.write(folder, [], test, MESSAGES))


def test_frames_keep_their_times_and_content(tmp_path: Path) -> None:
    (video,) = written(tmp_path, list(failures.pictures(1.5)))
    assert video == Video("camera-0.mp4", 160, 120, [round(n / 10, 4) for n in range(16)])
    with av.open(str(tmp_path / video.file)) as container:
        frames = list(container.decode(video=0))
    assert [frame.time for frame in frames] == pytest.approx(video.times, abs=1e-3)
    assert [frame.to_ndarray(format="gray").mean() for frame in frames] == pytest.approx(np.arange(16) * 10, abs=8)


@pytest.mark.parametrize(
    "fields",
    [
        {"format": "VP80", "data": b"\x00\x00\x01\x65"},
        {"format": "h264", "data": b"garbage"},
        {"format": "h264", "width": 60_000, "height": 60_000, "data": b"\x00\x00\x01\x65"},
        {"format": "h264", "width": 16, "height": 16, "data": b"\x00\x00\x01\x65garbage"},
    ],
)
def test_what_is_no_video_is_left_out(tmp_path: Path, fields: dict[str, Any]) -> None:
    assert written(tmp_path, [(0.1, "opendlv.proxy.ImageReading", 0, fields)]) == []
    assert [path.name for path in tmp_path.iterdir()] == ["test.rec"]


def test_a_recording_that_was_played_shows_its_frames_when_the_test_announced_them(tmp_path: Path) -> None:
    record(tmp_path / "played.rec", MadeDrive("x", 1.5, list(failures.pictures(1.5)), {}))
    shared = [(2 + n / 5, pictures.ANNOUNCED, 0, {"width": 160}) for n in range(10)]
    record(tmp_path / "test.rec", MadeDrive("x", 5.0, shared, {}))
    test = recorded.read(tmp_path / "test.rec", MESSAGES)
    played = pictures.Replayed(tmp_path / "played.rec", 0, 1.0, float("inf"))
    (video,) = pictures.write(tmp_path, [played], test, MESSAGES)
    assert video.times == pytest.approx([2 + n / 5 for n in range(6)])
    pictures.write_frame(tmp_path, video, 3.05)
    assert cv2.imread(str(tmp_path / "frame.jpg")).mean() == pytest.approx(150, abs=8)
