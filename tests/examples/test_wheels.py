"""The example with two wheels drives its test, the same way each time; with its wheels swapped it fails."""

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes

ROOT = Path(__file__).resolve().parents[2]
WAY = (
    "opendlv.sim.Frame",
    "opendlv.sim.KinematicState",
    "opendlv.proxy.AxleAngularVelocityReading",
    "opendlv.proxy.AccelerationReading",
)


def run(folder: Path) -> tuple[dict[str, object], str]:
    """The test's result, and a hash of all that moved, in values, names and sample times."""
    command = [sys.executable, "-m", "dodo_dsl", "run", "--report", "report"]
    subprocess.run(command, cwd=folder, capture_output=True, check=False)
    (test,) = json.loads((folder / "report" / "results.json").read_text())["tests"]
    ids = {MessageSet.standard().id(name) for name in WAY}
    recorded = read_envelopes(folder / "report" / "sil-two-wheels" / "test.rec")
    way = [(one.data_type, one.sender_stamp, one.sample_time, one.payload) for one in recorded if one.data_type in ids]
    assert {one[0] for one in way} == ids
    return test, hashlib.sha256(repr(way).encode()).hexdigest()


@pytest.fixture
def example(tmp_path: Path) -> Path:
    return shutil.copytree(ROOT / "examples" / "wheels", tmp_path / "wheels")


@pytest.mark.slow
@pytest.mark.parametrize("times", [2, pytest.param(20, marks=pytest.mark.proof)])
def test_two_wheels_drive_the_same_way_each_time(example: Path, times: int) -> None:
    drives = [run(example) for _ in range(times)]
    assert [test["outcome"] for test, _ in drives] == ["passed"] * times, drives[0][0]["reason"]
    assert len({(json.dumps(test["checks"]), way) for test, way in drives}) == 1


@pytest.mark.slow
def test_swapped_wheels_are_noticed(example: Path) -> None:
    compose = example / "docker-compose.yml"
    compose.write_text(compose.read_text().replace("--height=240", "--height=240 --swap"))
    test, _ = run(example)
    assert test["outcome"] == "failed" and "hit wall" in str(test["reason"])
