"""Whole tests in lockstep with applications that act by their own time."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.drive.applications import ROOT, dodo, program, results

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
STRAIGHT = "sil-closed-straight"
OUT = ["opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"]


def drive(compose: Path, code: int = 0, *words: str) -> dict[str, Any]:
    report = compose.parent / "report"
    dodo("run", STRAIGHT, "--application", str(compose), "--report", str(report), *words, code=code)
    return results(report)[STRAIGHT]


def test_one_who_acts_by_timers_drives_the_same_each_time(tmp_path: Path) -> None:
    """Also by the sandbox of the host, where its files lie elsewhere."""
    shutil.copy(HERE / "timed.py", tmp_path)
    compose = program(tmp_path, "python", "timed.py", **{"x-dodo": {"in": [], "out": OUT}})
    first, second = drive(compose), drive(compose, 0, "--isolation", "host")
    assert (first["outcome"], first["clock"]) == ("passed", "lockstep")
    assert first["checks"] == second["checks"]
    assert first["sim_s"] > 4.0


@pytest.mark.proof
def test_fifty_drives_under_load_are_one(tmp_path: Path) -> None:
    """Verdict, way and pictures; with another seed it is another drive."""
    shutil.copy(HERE / "timed.py", tmp_path)
    compose = program(tmp_path, "python", "timed.py", **{"x-dodo": {"in": [], "out": OUT}})
    words = [str(ROOT / "scripts/repeat-lockstep"), STRAIGHT, "50", "--application", str(compose)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=1500)
    assert done.returncode == 0, done.stdout
    assert f"{STRAIGHT}: 50 of 50 runs gave " in done.stdout
    assert drive(compose)["checks"] != drive(compose, 0, "--seed", "1")["checks"]


SPINS = """\
import sys, time
from dodo_dsl.opendlv.shared_memory import SharedMemory
name = next(word[7:] for word in sys.argv if word.startswith("--name="))
with SharedMemory.attach(name) as memory:
    for _ in range(3):
        memory.wait()
    while True:
        pass
"""


@pytest.mark.proof
def test_one_who_computes_without_end_is_named(tmp_path: Path) -> None:
    (tmp_path / "spins.py").write_text(SPINS)
    test = drive(program(tmp_path, "python", "spins.py", **{"x-dodo": {"in": [], "out": OUT}}), 1)
    assert test["outcome"] == "failed"
    assert "of service 'app' computed for 2 s without waiting; " in test["reason"]
    assert "in lockstep the test goes on only when all threads wait" in test["reason"]
