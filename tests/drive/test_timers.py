"""Whole tests in lockstep with applications that act by their own time."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.drive.applications import ROOT, dodo, kiwi, program, results

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


SINCE_ITS_START = """\
import sys, time
from dodo_dsl.opendlv import Session
with Session(int(next(word[6:] for word in sys.argv if word.startswith("--cid=")))) as session:
    names = ("GroundSteering", "PedalPosition")
    steering, pedal = (session.messages.type(f"opendlv.proxy.{name}Request") for name in names)
    begin = time.time()
    while True:
        session.send(steering(groundSteering=0.0))
        session.send(pedal(position=0.1 if time.time() - begin < 0.5 else 0.0))
        time.sleep(0.05)
"""


def test_what_acts_by_the_time_since_its_start_does_so_in_the_test(tmp_path: Path) -> None:
    (tmp_path / "ramp.py").write_text(SINCE_ITS_START)
    test = drive(program(tmp_path, "python", "ramp.py", **{"x-dodo": {"in": [], "out": OUT}}), 1)
    (distance,) = (check["value"] for check in test["checks"] if check["name"] == "distance")
    assert 0.1 < distance < 1.0, "it went for half a second and then stood"
    assert "no program of the application waited for a frame of 'camera'" in test["notes"][0]


def test_who_cannot_load_the_library_is_stepped_by_answers_to_the_same_values(tmp_path: Path) -> None:
    compose = kiwi(tmp_path / "kiwi")
    loaded = drive(compose)
    subprocess.run(
        ["cc", "-static", "-o", compose.parent / "start", "-xc", "-"], check=True, text=True,
        input="#include <unistd.h>\nint main(int n, char **words) { return execvp(words[n > 0], words + 1); }",
    )  # fmt: skip
    compose.write_text(compose.read_text().replace("- python\n", "- ./start\n    - python\n"))
    found = drive(compose)
    assert (found["checks"], found["response"]) == (loaded["checks"][:-1], None)
    assert found["notes"][0].startswith("lockstep by answers: service 'perception' starts ")


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
