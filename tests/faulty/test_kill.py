"""Each fault against the one shipped test that has to catch it, all in one run."""

import re
import shutil
from pathlib import Path

import pytest
import yaml

from tests.drive.applications import ROOT, dodo, results
from tests.faulty.matrix import APPLICATION
from tests.faulty.table import FAULTS, Fault

LONG = {"slow-computing", "slow-sleeping"}  # take half a minute each: scripts/kill-matrix runs them
CAUGHT = sorted(
    (fault for fault in FAULTS.values() if not fault.due and fault.name not in LONG), key=lambda fault: fault.name
)
FIRST_CID = 128
SILENT = "4"  # tests at a time, as some of them only wait until an application has been silent for too long

SHORTER = "12 s"  # for applications that stand still; the example needs 5.71 s


def copy_of(fault: Fault, registry: Path) -> None:
    """The test that has to catch a fault, under the fault's name: with one application, the bus tells them apart."""
    shipped, *choices = fault.test.split("--")
    spec: dict[str, object] = {
        "dodo": 1,
        "name": fault.name,
        "extends": f"../{shipped}/{shipped}.dodo.yml",
        "description": fault.does,
        "clock": "lockstep",
    }
    if shipped == "sil-closed-straight":
        spec["evaluation"] = {"track": {"with": {"max-time": SHORTER}}}
    if choices:
        spec["matrix"] = {
            key: [yaml.safe_load(value)] for key, _, value in (choice.partition("-") for choice in choices)
        }
    folder = registry / fault.name
    folder.mkdir()
    (folder / f"{fault.name}.dodo.yml").write_text(yaml.safe_dump(spec, sort_keys=False))


@pytest.mark.realtime  # as it takes the whole machine, not for its clock
def test_each_fault_is_caught_and_its_cause_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    registry, report = tmp_path / "tests", tmp_path / "report"
    shutil.copytree(ROOT / "tests_registry", registry)
    for fault in CAUGHT:
        copy_of(fault, registry)
    by_bus = dict(enumerate(CAUGHT, FIRST_CID))
    monkeypatch.setenv("FAULT", ",".join(f"{cid}={fault.name}" for cid, fault in by_bus.items()))
    specs = [str(registry / fault.name / f"{fault.name}.dodo.yml") for fault in CAUGHT]
    dodo("run", *specs, "--application", str(APPLICATION), "--report", str(report), "--jobs", SILENT, code=1)

    found = {test["slug"].partition("--")[0]: test for test in results(report).values()}
    assert {name: test["cid"] for name, test in found.items()} == {fault.name: cid for cid, fault in by_bus.items()}
    wrong = [
        f"{fault.name}: expected '{fault.words}', {found[fault.name]['outcome']}: {found[fault.name]['reason']}"
        for fault in CAUGHT
        if found[fault.name]["outcome"] != "failed" or not re.search(fault.words, found[fault.name]["reason"])
    ]
    assert not wrong, "\n".join(wrong)
