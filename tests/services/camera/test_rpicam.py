from pathlib import Path

import pytest

from services.camera.sources import CameraError, RpiCamera, rpicam_command


def test_pictures_come_whole_and_in_order(rpicam: Path) -> None:
    camera = RpiCamera(64, 48, freq=50, exposure=0.02)
    pictures = [camera.read() for _ in range(3)]
    camera.close()
    assert [int(p.i420[0, 0]) for p in pictures] == [17, 18, 19]
    assert all((p.i420[:48] == p.i420[0, 0]).all() and (p.i420[48:] == 128).all() for p in pictures)
    times = [p.time for p in pictures]
    assert None not in times and times == sorted(times, key=lambda t: t or 0)
    assert rpicam.read_text().split("\n") == rpicam_command(64, 48, 50, 0.02)[1:]


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("missing", r"rpicam-vid ended with code 255: ERROR: \*\*\* no cameras available \*\*\*"),
        ("lost", r"rpicam-vid ended with code 1: ERROR: \*\*\* Device timeout detected \*\*\*"),
    ],
)
def test_why_it_ended(rpicam: Path, monkeypatch: pytest.MonkeyPatch, mode: str, words: str) -> None:
    monkeypatch.setenv("FAKE_MODE", mode)
    camera = RpiCamera(64, 48, freq=100, exposure=0.01)
    with pytest.raises(CameraError, match=words):
        for _ in range(4):
            camera.read()
    camera.close()


def test_padded_rows_and_a_missing_program(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="a multiple of 64, not 100"):
        RpiCamera(100, 48, 10, 0.1)
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(OSError, match="there is no program 'rpicam-vid' on PATH"):
        RpiCamera(64, 48, 10, 0.1)
