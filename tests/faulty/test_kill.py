"""Faults against the one shipped test that has to catch them, in one run: one of each kind, in `make proof` all."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.drive.applications import ROOT, dodo, results
from tests.drive.variants import registry, variant
from tests.examples.ros import NODES, copy, needs_ros, run
from tests.faulty.matrix import APPLICATION
from tests.faulty.table import FAULTS, RANGES, ROS, Fault

LONG = {"slow-computing", "slow-sleeping"}  # take half a minute each: scripts/kill-matrix runs them
CAUGHT = sorted((fault for fault in FAULTS.values() if fault.name not in LONG), key=lambda fault: fault.name)
FEW = [FAULTS[name] for name in ("pedal-zero", "steering-whole-degrees", "wrong-message", "yellow-ignored")]
"""One of each kind, by each kind of evaluator."""
FIRST_CID = 128
SILENT = "4"  # tests at a time, as some of them only wait until an application has been silent for too long

ROS_FEW = ("ros-frame-ignored", "ros-degrees", "ros-unstamped")
SMALL_BUFFERS = "environment: {FASTDDS_BUILTIN_TRANSPORTS: 'UDPv4?max_msg_size=65500&sockets_size=65536'}"

SHORTER = "12 s"  # for applications that stand still; the example needs 5.71 s


def copy_of(fault: Fault, tests: Path) -> Path:
    """The test that has to catch a fault, under the fault's name: with one application, the bus tells them apart."""
    keys: dict[str, object] = {"description": fault.does, "clock": "lockstep"}
    if fault.test == "sil-closed-straight":
        keys["evaluation"] = {"track": {"with": {"max-time": SHORTER}}}
    return variant(tests, fault.test, fault.name, **keys)


@pytest.mark.slow
@pytest.mark.parametrize("faults", [FEW, pytest.param(CAUGHT, marks=pytest.mark.proof)], ids=["few", "all"])
def test_each_fault_is_caught_and_its_cause_named(
    faults: list[Fault], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tests = registry(tmp_path)
    specs = [str(copy_of(fault, tests)) for fault in faults]
    caught(faults, specs, APPLICATION, tmp_path / "report", monkeypatch)


@pytest.mark.slow
def test_faults_of_range_sensors_are_caught(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one run with the application without a fault, which passes."""
    faults = sorted(RANGES.values(), key=lambda fault: fault.name)
    shutil.copytree(ROOT / "examples" / "ranges" / "tests", tmp_path / "tests")
    specs = [str(variant(tmp_path / "tests", fault.test, fault.name)) for fault in faults]
    specs.append(str(tmp_path / "tests" / "sil-closed-corridor" / "sil-closed-corridor.dodo.yml"))
    application = Path(__file__).with_name("ranges.compose.yml")
    (good,) = caught(faults, specs, application, tmp_path / "report", monkeypatch)
    assert (good["slug"], good["outcome"]) == ("sil-closed-corridor", "passed"), good["reason"]


@needs_ros
@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name if name in ROS_FEW else pytest.param(name, marks=pytest.mark.proof) for name in sorted(ROS)]
)
def test_faults_of_ros_nodes_are_caught(name: str, tmp_path: Path) -> None:
    fault = ROS[name]
    application = fault.test.removeprefix("sil-")
    folder = copy(application, tmp_path)
    shutil.copy(Path(__file__).with_name("of_ros.py"), folder)
    deployment, compose = folder / "dodo.yml", folder / "docker-compose.yml"
    node = NODES[application]
    deployment.write_text(deployment.read_text().replace(f"{node}.py]", f"of_ros.py, {node}, {name}]"))
    if name == "ros-best-effort-lost":
        compose.write_text(
            compose.read_text().replace("network_mode: host", f"network_mode: host\n    {SMALL_BUFFERS}")
        )
    test = run(folder)
    about = f"{test['reason']} {test['notes']}"
    assert test["outcome"] == "failed" and re.search(fault.words, about), about


def caught(
    faults: list[Fault], specs: list[str], application: Path, report: Path, monkeypatch: pytest.MonkeyPatch
) -> list[dict[str, Any]]:
    """Each spec of a fault has to fail with the words of that; the results of other specs."""
    by_bus = dict(enumerate(faults, FIRST_CID))
    monkeypatch.setenv("FAULT", ",".join(f"{cid}={fault.name}" for cid, fault in by_bus.items()))
    dodo("run", *specs, "--application", str(application), "--report", str(report), "--jobs", SILENT, code=1)

    found = {test["slug"].partition("--")[0]: test for test in results(report).values()}
    of_faults = {fault.name: found.pop(fault.name) for fault in faults}
    assert {name: test["cid"] for name, test in of_faults.items()} == {fault.name: cid for cid, fault in by_bus.items()}
    wrong = [
        f"{fault.name}: expected '{fault.words}', {of_faults[fault.name]['outcome']}: {of_faults[fault.name]['reason']}"
        for fault in faults
        if of_faults[fault.name]["outcome"] != "failed" or not re.search(fault.words, of_faults[fault.name]["reason"])
    ]
    assert not wrong, "\n".join(wrong)
    return list(found.values())
