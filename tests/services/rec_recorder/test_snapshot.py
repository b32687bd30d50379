from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.recording import read_envelopes
from services.rec_recorder.pictures import Snapshot
from services.rec_recorder.source import MemorySpec, PictureSource
from tests.services.built import built
from tests.services.rec_recorder.test_pictures import HEIGHT, WIDTH, CameraMemory, scene


@pytest.fixture
def camera() -> Iterator[CameraMemory]:
    camera = CameraMemory("argb")
    with camera.memory:
        yield camera


def taken(path: Path) -> list[int]:
    """Which picture the file holds; empty without one."""
    if not path.exists():
        return []
    found = cv2.imread(str(path))
    return [n for n in range(9) if np.array_equal(found, pixels.converted(scene(n, "argb"), "argb", "bgr"))]


@pytest.mark.parametrize(
    ("width", "place", "words"),
    [(WIDTH + 2, ".", "not those of a picture of 162 x 120"), (WIDTH, "nowhere", "No such file")],
)
def test_what_cannot_be_written_is_told(
    camera: CameraMemory, tmp_path: Path, caplog: pytest.LogCaptureFixture, width: int, place: str, words: str
) -> None:
    snapshot = Snapshot(PictureSource(MemorySpec(camera.name, width, HEIGHT), 1), tmp_path / place / "snapshot.png")
    snapshot.update(0)
    snapshot.begin()
    camera.show(1)
    snapshot.update(1)
    snapshot.close()
    (record,) = caplog.records
    assert record.getMessage().startswith("no snapshot was taken: ") and words in record.getMessage()


def test_the_recorder_takes_one_without_recording_frames(camera: CameraMemory, tmp_path: Path) -> None:
    path = tmp_path / "snapshot.png"
    memories = f"--memories={camera.name}:{WIDTH}x{HEIGHT}"
    with built("rec_recorder", f"--rec={tmp_path / 'drive.rec'}", f"--snapshot={path}", memories) as recorder:
        for number in (0, 1, 2):
            recorder.update(number)
            if number == 2:
                recorder.begin(number)
            camera.show(number)
        recorder.update(3)
    assert taken(path) == [2]
    assert [envelope.data_type for envelope in read_envelopes(tmp_path / "drive.rec")] == [2906]
