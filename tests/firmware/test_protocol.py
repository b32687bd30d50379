"""The one table of the protocol, and what is made of it."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from services.gantry import rig_table
from tests.firmware.programs import ROOT

SCRIPT = ROOT / "scripts" / "make-protocol"


def test_what_is_made_of_the_table_is_up_to_date() -> None:
    done = subprocess.run([sys.executable, SCRIPT, "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not (ROOT / ".venv").is_dir(), reason="DoDo is not installed in .venv")
def test_scripts_use_the_python_of_the_checkout(tmp_path: Path) -> None:
    """Whichever runs them: one without any package, as the system's may be."""
    bare = [str(ROOT / ".venv" / "bin" / "python"), "-c", "import sys; print(sys._base_executable)"]
    base = subprocess.run(bare, capture_output=True, text=True, check=True).stdout.strip()
    words = [base, "-S", SCRIPT, "--check"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.thorough
def test_a_stale_file_is_named(tmp_path: Path) -> None:
    for name in ("firmware/protocol.yml", "scripts/make-protocol"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    for name in ("firmware/gantry/protocol.h", "docs/reference/serial-protocol.md", "services/gantry/rig_table.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("old", encoding="utf-8")
    words = [sys.executable, str(tmp_path / "scripts/make-protocol")]
    done = subprocess.run([*words, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.count("is out of date") == 3
    assert subprocess.run(words, check=True).returncode == 0
    assert subprocess.run([*words, "--check"], check=True).returncode == 0
    made = tmp_path / "services/gantry/rig_table.py"
    assert made.read_bytes() == (ROOT / "services/gantry/rig_table.py").read_bytes()


def test_the_numbers_are_those_of_table_4_2_and_of_the_workspace() -> None:
    raw = yaml.safe_load((ROOT / "firmware" / "protocol.yml").read_text(encoding="utf-8"))["axes"]
    assert [raw[axis]["offset_steps"] for axis in ("x", "y", "yaw")] == [2988, 2324, 83]
    assert (raw["x"]["steps_per_m"], raw["y"]["steps_per_m"], raw["yaw"]["steps_per_deg"]) == (3320, 3320, 0.55)
    assert rig_table.BOUNDS["x"] == (-0.9, 0.95)
    assert rig_table.BOUNDS["y"] == (-0.7, 0.7)
    assert rig_table.BOUNDS["yaw"] == pytest.approx((-2.633861, 2.967060), abs=2e-6)


def test_commands_and_codes_are_those_of_table_4_1() -> None:
    own = {"LIMITS", "SETLIMITS", "FORGET"}
    assert set(rig_table.COMMANDS) == {"GOTO", "RUN", "STOP", "CALIBRATE", "POSITION", "STATUS"} | own
    assert [status.value for status in rig_table.Status] == list(range(9))
    assert len({error.value for error in rig_table.Error}) == len(rig_table.Error)
