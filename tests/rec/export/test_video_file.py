"""Videos against the packets of the recording, as a demuxer has them."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.video import MOST_GAP
from tests.rec.conftest import BEGIN, HEIGHT, WIDTH, dodo_rec, message, pictures, video

STEPS = (0, 100_000, 133_333, 240_001, 1_000_000, 1_000_001, 2_345_678)


def demuxed(path: Path) -> list[tuple[int, bool, bytes]]:
    """Time in us, whether it is a key frame, and content of each packet."""
    with av.open(str(path)) as container:
        (stream,) = container.streams
        found = [packet for packet in container.demux(stream) if packet.size]
        scale = Fraction(1_000_000) * (stream.time_base or 0)
        return [(int((packet.pts or 0) * scale), packet.is_keyframe, bytes(packet)) for packet in found]


def shown(path: Path) -> list[np.ndarray[Any, Any]]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]


def times(path: Path) -> list[int]:
    return [time for time, _, _ in demuxed(path)]


def assert_shown(path: Path, expected: list[np.ndarray[Any, Any]]) -> None:
    for frame, picture in zip(shown(path), expected, strict=True):
        assert abs(frame.astype(int) - picture).max() <= 10


def test_frames_are_shown_at_their_sample_times(record: Callable[..., Path], tmp_path: Path) -> None:
    envelopes = [each._replace(sample_time=BEGIN + step) for each, step in zip(video(7), STEPS, strict=True)]
    target = tmp_path / "new" / "drive.mp4"
    answer = dodo_rec("export", record(envelopes), "--video", "-o", target)
    assert answer == (0, f"{target}: 7 frames of {WIDTH} x {HEIGHT} pixels\n", "")
    assert times(target) == list(STEPS)
    assert_shown(target, pictures(7))


@pytest.mark.slow
def test_a_real_drive(shared_data: Callable[[str], Path], tmp_path: Path) -> None:
    path, target = shared_data("track-1-2025-05-08.rec"), tmp_path / "track.mp4"
    assert dodo_rec("export", path, "--video", "-o", target).code == 0
    with Recording(path) as recording:
        sampled = [each.sample_time for each in recording.envelopes(recording.rows(messages=[1055]))]
    assert times(target) == [time - sampled[0] for time in sampled]


def test_what_comes_before_the_first_key_frame_or_is_broken_is_told(
    record: Callable[..., Path], tmp_path: Path
) -> None:
    envelopes = video(12)[2:]
    broken = [envelopes[5]._replace(payload=b"\x0b"), message("opendlv.proxy.ImageReading", BEGIN + 5, format="h264")]
    path, target = record([*envelopes, *broken], before=b"??"), tmp_path / "out.mp4"
    answer = dodo_rec("export", path, "--video", "-o", target)
    assert answer.code == 0
    assert answer.stderr.endswith("5 packets cannot be decoded\n")
    assert "skipped 2 bytes" in answer.stderr
    assert_shown(target, pictures(12)[5:])


def test_times_out_of_order_and_far_apart(record: Callable[..., Path], tmp_path: Path) -> None:
    sampled = [10, 20, 15, 30, 30 + 2 * MOST_GAP]
    path = record([each._replace(sample_time=time) for each, time in zip(video(5), sampled, strict=True)])
    assert dodo_rec("export", path, "--video", "-o", tmp_path / "out.mp4").stderr == ""
    assert times(tmp_path / "out.mp4") == [0, 10, 11, 20, 20 + MOST_GAP]


def test_other_formats(record: Callable[..., Path], tmp_path: Path) -> None:
    jpegs = [cv2.imencode(".jpg", picture)[1].tobytes() for picture in pictures(4)]
    envelopes = [
        message("opendlv.proxy.ImageReading", BEGIN + number * 50_000, data=data, format="mjpg")
        for number, data in enumerate(jpegs)
    ]
    assert dodo_rec("export", record(envelopes), "--video", "-o", tmp_path / "out.mp4").code == 0
    assert times(tmp_path / "out.mp4") == [0, 50_000, 100_000, 150_000]
    assert_shown(tmp_path / "out.mp4", pictures(4))


def jpeg(width: int, time: int) -> Envelope:
    data = cv2.imencode(".jpg", np.zeros((HEIGHT, width, 3), np.uint8))[1].tobytes()
    return message("opendlv.proxy.ImageReading", time, data=data, format="mjpg")


@pytest.mark.parametrize(
    ("envelopes", "words", "text"),
    [
        (video(5)[1:5], (), "no frame of {path} can be decoded"),
        ([jpeg(64, 1), jpeg(32, 2)], (), "{path}: a frame of 32 x 48 pixels follows such of 64 x 48"),
        ([jpeg(33, 1)], (), "{path}: h264 needs an even width and height, not 33 x 48"),
        ([*video(1), *video(1, 5, 3)], (), "{path} holds frames of the cameras 0, 3; choose one with --camera"),
        (video(1), ("--message", "1055"), "--message does not apply to --video; choose a sender with --camera"),
    ],
)
def test_what_cannot_be_exported(
    envelopes: list[Envelope], words: tuple[str, ...], text: str, record: Callable[..., Path], tmp_path: Path
) -> None:
    path = record(envelopes)
    answer = dodo_rec("export", path, "--video", "-o", tmp_path / "out.mp4", *words)
    assert (answer.code, answer.stdout) == (2, "")
    assert f"dodo rec: {text.format(path=path)}" in answer.stderr
    assert [entry.name for entry in tmp_path.iterdir()] == ["drive.rec"]


def test_the_default_file_and_what_is_there(
    record: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    record(video(2))
    assert dodo_rec("export", "drive.rec", "--video").stdout.startswith("drive.mp4: 2 frames")
    assert dodo_rec("export", "drive.rec", "--video").stderr.endswith("--force replaces it\n")
    assert dodo_rec("export", "drive.rec", "--video", "--force").code == 0
    before = (tmp_path / "drive.rec").read_bytes()
    assert "is the recording itself" in dodo_rec("export", "drive.rec", "--video", "-o", "drive.rec", "--force").stderr
    assert (tmp_path / "drive.rec").read_bytes() == before


@pytest.mark.slow
def test_a_full_disk_leaves_nothing(record: Callable[..., Path], small_disk: Path) -> None:
    noise = np.random.default_rng(5).integers(0, 255, (12, HEIGHT, WIDTH, 3), np.uint8)
    envelopes = [
        message("opendlv.proxy.ImageReading", BEGIN + number * 50_000, format="mjpg",
                data=cv2.imencode(".jpg", picture)[1].tobytes())
        for number, picture in enumerate([*noise] * 20)
    ]  # fmt: skip
    answer = dodo_rec("export", record(envelopes), "--video", "-o", small_disk / "out.mp4")
    assert (answer.code, answer.stderr) == (3, f"dodo rec: {small_disk}/out.mp4: No space left on device\n")
    assert list(small_disk.iterdir()) == []
