"""The example of each README starts its service alone, which is ready and ends cleanly on a signal."""

import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.services.gantry.fakerig import FakeRig
from tests.services.process import PATIENCE, ROOT

SERVICES = ["beacon", "camera", "dynamic_model", "integrator"]


def example(service: str) -> list[str]:
    text = (ROOT / "services" / service / "README.md").read_text()
    (line,) = re.findall(rf"^    (python -m services\.{service} .*)$", text, re.MULTILINE)
    return shlex.split(line)


def start(words: list[str], cid: int, folder: Path) -> "subprocess.Popen[str]":
    """The example on another session, so that examples do not disturb one another."""
    words = [f"--cid={cid}" if word.startswith("--cid=") else word for word in words]
    return subprocess.Popen(
        [sys.executable, *words[1:]],
        cwd=ROOT,
        env={"PATH": "/usr/bin:/bin", "DODO_READY_FILE": str(folder / "ready")},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ends_cleanly(process: "subprocess.Popen[str]") -> None:
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == '{"dodo": "ready"}\n', process.communicate(timeout=PATIENCE)[1]
        process.send_signal(signal.SIGTERM)
        err = process.communicate(timeout=PATIENCE)[1]
        assert (process.returncode, err) == (0, "")
    finally:
        process.kill()
        process.communicate()


def test_the_gantrys_example_runs(cid: int, tmp_path: Path) -> None:
    with FakeRig(tmp_path / "rig") as rig:
        words = [w.replace("/dev/ttyACM0", str(rig.path)) for w in example("gantry")]
        ends_cleanly(start(words, cid, tmp_path))
        assert rig.last() == "STOP"


@pytest.mark.parametrize("service", SERVICES)
def test_the_example_runs(service: str, cid: int, tmp_path: Path) -> None:
    ends_cleanly(start(example(service), cid, tmp_path))
