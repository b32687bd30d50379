import uuid
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.opendlv.shared_memory import SharedMemory
from tests.services.built import built, refusal
from tests.services.process import PATIENCE, launch, running

SIZE = ["--width=64", "--height=48"]


@pytest.fixture
def names(cid: int) -> Iterator[list[str]]:
    prefix = f"dodo-test-{uuid.uuid4().hex[:8]}"
    yield [f"--cid={cid}", f"--name.argb={prefix}.argb", f"--name.i420={prefix}.i420"]


def attached(names: list[str]) -> tuple[SharedMemory, SharedMemory]:
    argb, i420 = (SharedMemory.attach(flag.partition("=")[2]) for flag in names[1:])
    return argb, i420


@pytest.mark.realtime
def test_a_video_goes_into_both_memories_at_its_times(tmp_path: Path, names: list[str], video: Path) -> None:
    flags = [*names, *SIZE, "--source=file", f"--file={video}", "--freq=20"]
    with running("camera", tmp_path, *flags):
        argb, i420 = attached(names)
        with argb, i420:
            assert (argb.size, i420.size) == (64 * 48 * 4, 64 * 48 * 3 // 2)
            times, greys = [], []
            for _ in range(4):
                assert argb.wait(PATIENCE)
                with argb.lock():
                    times.append(argb.sample_time())
                    greys.append(round(float(np.frombuffer(argb.buffer, np.uint8).reshape(48, 64, 4)[..., 0].mean())))
            with i420.lock():  # which may be a picture behind, as it is shared second
                assert i420.sample_time() >= times[-2] and np.frombuffer(i420.buffer, np.uint8).max() > 16
    assert all(gap % 50_000 == 0 and gap > 0 for gap in np.diff(times))
    assert all(any(abs(grey - shown) <= 2 for shown in (40, 80, 120, 160, 200)) for grey in greys)
    assert len(set(greys)) > 1


@pytest.mark.realtime
def test_a_camera_that_stops_ends_it_with_a_sentence(
    tmp_path: Path, names: list[str], rpicam: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MODE", "stopped")
    process = launch("camera", tmp_path, *names, *SIZE, "--source=rpicam", "--freq=20", "--exposure=0.05")
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, '{"dodo": "ready"}' in out) == (1, True)
    assert "the camera rpicam gave no picture for 1.5 s" in err and "Traceback" not in err


def test_each_update_shares_a_picture(names: list[str], video: Path) -> None:
    three = [flag.replace("argb", kind) for flag in names[1:2] for kind in ("bgr", "rgb")]
    flags = [*names[1:], *three, *SIZE, "--source=file", f"--file={video}", "--freq=20"]
    with built("camera", *flags) as camera:
        argb, i420 = attached(names)
        bgr, rgb = attached(["", *three])
        with argb, i420, bgr, rgb:
            greys = []
            for now in range(1_000_000, 1_350_000, 50_000):
                camera.update(now)
                with i420.lock():
                    assert i420.sample_time() == now
                with argb.lock():
                    assert argb.sample_time() == now
                    pixels = np.frombuffer(argb.buffer, np.uint8).reshape(48, 64, 4)[..., :3].copy()
                    greys.append(round(float(pixels[..., 0].mean())))
                for memory, shown in ((bgr, pixels), (rgb, pixels[..., ::-1])):
                    with memory.lock():
                        assert memory.sample_time() == now and bytes(memory.buffer[: shown.size]) == shown.tobytes()
    assert greys == pytest.approx([40, 80, 120, 160, 200, 40, 80], abs=2)
    assert camera.period == 50_000


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--source=file"], "--file is missing"),
        (["--source=file", "--file=/none.png"], "there is no file '/none.png'"),
        (["--source=webcam"], "--source=webcam is not a camera, expected a device such as /dev/video0"),
        (["--source=/dev/video99"], "there is no camera /dev/video99; is it plugged in?"),
        (["--source=/dev/null"], "the camera /dev/null cannot be opened"),
        (["--source=emulated"], "is the camera of 'rig: emulated'"),
        (["--source=rpicam", "--freq=20"], "--exposure=0.1 does not fit into the 0.05 s between two pictures"),
        (
            ["--source=file", "--width=63"],
            "argument --width: '63', expected integer, at least 2, at most 8192, a multiple of 2",
        ),
    ],
)
def test_what_is_not_a_camera(names: list[str], flags: list[str], words: str) -> None:
    size = [word for word in SIZE if word.partition("=")[0] not in {flag.partition("=")[0] for flag in flags}]
    assert words in refusal("camera", *names[1:], *size, *flags)
