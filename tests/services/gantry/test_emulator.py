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


LATE = """#!/bin/sh
echo '{"event": "late", "t": 0.1, "late": 9.0, "total": 9.0}'
echo '{"ready": true, "port": "/dev/pts/99"}'
while [ ! -e "$0-go" ]; do sleep 0.02; done
cat "$0-go"
exec sleep 60
"""
TIMES = {
    "pauses": ([0.06, 0.1, 0.08], ""),
    "too many pauses": ([0.06, 0.1, 0.1], "could not keep real time: it stood still for 0.260 s in "),
    "a pause that is too long": ([0.3], "could not keep real time: it stood still for 0.300 s in "),
}


@pytest.mark.parametrize(("times", "why"), TIMES.values(), ids=TIMES)
def test_short_pauses_are_no_fault(tmp_path: Path, times: list[float], why: str) -> None:
    """What was before the test began does not count."""
    program, go = tmp_path / "rig-emulator", tmp_path / "go"
    program.write_text(LATE)
    program.chmod(0o755)
    lines = [f'{{"event": "late", "t": 1.0, "late": {late}, "total": 9.0}}\n' for late in times]
    go.write_text("".join(lines) + '{"x": 0.1, "y": 0.2, "yaw": 0.3, "t": 0.1}\n')
    with EmulatedRig(tmp_path) as rig:
        rig.watch()
        go.rename(f"{program}-go")
        end, found = time.monotonic() + 10, ""
        while rig.paused < sum(times) - 1e-9 and time.monotonic() < end:
            time.sleep(0.01)
        try:
            while rig.position() is None and time.monotonic() < end:
                time.sleep(0.01)
        except RigError as error:
            found = str(error)
    assert rig.paused == pytest.approx(sum(times))
    assert why in found if why else not found
