"""The emulated rig's program as others than the real one say things."""

import time
from pathlib import Path

import pytest

from services.gantry.emulator import EmulatedRig
from services.gantry.link import RigError

SAYS = """#!/bin/sh
echo '{"ready": true, "port": "/dev/pts/99"}'
echo '{"x": 0.1, "y": 0.2, "yaw": 0.3, "t": 0.1}'
echo '{"event": "late", "la'
exec sleep 60
"""


def test_what_cannot_be_read_is_an_error_and_no_silence(tmp_path: Path) -> None:
    (tmp_path / "rig-emulator").write_text(SAYS)
    (tmp_path / "rig-emulator").chmod(0o755)
    with EmulatedRig(tmp_path) as rig, pytest.raises(RigError, match=r"sent an unreadable line: .*\"late\", \"la$"):
        end = time.monotonic() + 10
        while time.monotonic() < end:
            rig.position()
