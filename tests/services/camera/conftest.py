import os
import stat
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

FAKE = '''#!{python}
"""A camera of a Raspberry Pi: pictures whose brightness counts up; MODE makes it misbehave."""
import os, sys, time
flags = dict(zip(sys.argv[1::1], sys.argv[2::1]))
open(os.environ["FAKE_ARGV"], "w").write("\\n".join(sys.argv[1:]))
mode = os.environ.get("FAKE_MODE", "")
width, height = int(flags["--width"]), int(flags["--height"])
sys.stderr.write("[0:00:01] INFO Camera starts\\n")
if mode == "missing":
    sys.stderr.write("ERROR: *** no cameras available ***\\n")
    sys.exit(255)
count = 0
while mode != "silent":
    count += 1
    picture = bytes([16 + count]) * (width * height) + bytes([128]) * (width * height // 2)
    for part in (picture[:1000], picture[1000:]):
        sys.stdout.buffer.write(part)
        sys.stdout.buffer.flush()
    if mode in ("lost", "stopped") and count == 3:
        if mode == "lost":
            sys.stderr.write("ERROR: *** Device timeout detected ***\\n")
            sys.exit(1)
        break
    time.sleep(1 / float(flags["--framerate"]))
time.sleep(60)
'''


@pytest.fixture
def rpicam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fake `rpicam-vid` on PATH; the path is that of the file which takes its arguments."""
    program = tmp_path / "bin" / "rpicam-vid"
    program.parent.mkdir()
    program.write_text(FAKE.replace("{python}", sys.executable))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    monkeypatch.setenv("FAKE_ARGV", str(tmp_path / "argv"))
    return tmp_path / "argv"


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Five pictures of 64 x 48, each one grey: 40, 80, ..."""
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (64, 48))
    for grey in range(40, 201, 40):
        writer.write(np.full((48, 64, 3), grey, np.uint8))
    writer.release()
    return path
