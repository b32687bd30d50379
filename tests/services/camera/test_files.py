from pathlib import Path

import cv2
import numpy as np
import pytest

from services.camera.sources import FileCamera


def grey(camera: FileCamera) -> int:
    return round(float(camera.take().argb[..., 1].mean()))


def test_a_video_is_shown_over_and_over(video: Path) -> None:
    camera = FileCamera(video, 64, 48)
    assert [grey(camera) for _ in range(12)] == pytest.approx([40, 80, 120, 160, 200] * 2 + [40, 80], abs=2)
    assert camera.take().time is None
    camera.close()


def test_an_image_stays(tmp_path: Path) -> None:
    path = tmp_path / "board.png"
    cv2.imwrite(str(path), np.full((48, 64, 3), 77, np.uint8))
    camera = FileCamera(path, 32, 24)
    for _ in range(2):
        assert camera.take().argb.shape == (24, 32, 4)
        assert grey(camera) == 77


def test_what_holds_no_pictures(tmp_path: Path) -> None:
    (tmp_path / "text.avi").write_text("no film")
    for name, words in (("text.avi", "has no pictures"), ("none.avi", "there is no file")):
        with pytest.raises((ValueError, OSError), match=words):
            FileCamera(tmp_path / name, 64, 48)


def test_a_recording(shared_data) -> None:  # type: ignore[no-untyped-def]
    camera = FileCamera(shared_data("track-1-2025-05-08.rec"), 640, 360)
    first, second = camera.take(), camera.take()
    assert first.argb.shape == second.argb.shape == (360, 640, 4)
    assert first.argb.std() > 20 and (first.argb != second.argb).any()
