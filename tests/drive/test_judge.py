"""Recordings judged again. That evaluators count as shapely, numpy and COCO, their own tests show."""

import io
import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.outcome import SAMPLE_TIMES, SLOW_ANSWERS
from tests.drive.applications import ROOT, dodo, kiwi, results

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("judged")]


@dataclass(frozen=True)
class Runs:
    """The report of a run of several tests."""

    report: Path
    tests: dict[str, dict[str, Any]]

    def recording(self, slug: str) -> Path:
        return self.report / slug / "test.rec"

    def checks(self, slug: str) -> dict[str, float]:
        """The values by name."""
        return {check["name"]: check["value"] for check in self.tests[slug]["checks"]}


def run(report: Path, *words: str) -> Runs:
    """Run tests that the example application passes."""
    dodo("run", *words, "-j", "2", "--report", str(report), code=0)
    return Runs(report, results(report))


def judged(code: int, *words: str | Path) -> dict[str, Any]:
    """What ``dodo judge --json`` says, in this process."""
    out, err = io.StringIO(), io.StringIO()
    assert main(["judge", *map(str, words), "--json"], out, err) == code, out.getvalue() + err.getvalue()
    document: dict[str, Any] = json.loads(out.getvalue())
    return document


REGISTRY = ROOT / "tests_registry"
STRAIGHT, CURVE, SIGNAL = "sil-closed-straight", "sil-closed-left-curve", "sil-open-straight"
CONES, BOARD = "sil-perception--light-1--clutter-0", "dil-static-rig"
OTHERS = (
    "sil-closed-kiwi-track",
    "sil-open-left-curve",
    "sil-empty-pictures",
    "sil-closed-two-cars",
    "sil-perception-cars",
)
ALL = (STRAIGHT, CURVE, SIGNAL, CONES, BOARD, "dil-kiwi-track", *OTHERS)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return run(tmp_path_factory.mktemp("judged"), *ALL)


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_the_example_passes_every_shipped_test(runs: Runs) -> None:
    """Closed and open loop, perception, and recordings."""
    names = {path.name for path in REGISTRY.glob("[sd]il-*")}
    assert {slug.partition("--")[0] for slug in runs.tests} == names
    assert sum(test["sim_s"] for test in runs.tests.values()) > 40
    for slug, test in runs.tests.items():
        assert (test["outcome"], test["clock"], test["checks"] != []) == ("passed", "lockstep", True), test
        assert runs.recording(slug).stat().st_size > 10_000
    assert runs.checks(BOARD)["true-positives"] > 300
    assert runs.checks("sil-perception-cars")["recall-car"] > 0.9
    assert 0.2 < runs.checks("sil-closed-two-cars")["body-margin"] < 0.35
    assert runs.checks("sil-closed-two-cars")["time-to-goal"] > 8.5, "the other car is ahead until then"


@pytest.mark.parametrize("slug", ALL)
def test_judged_again_it_is_the_same_bit_for_bit(runs: Runs, slug: str) -> None:
    test = dict(runs.tests[slug])
    test["checks"] = [check for check in test["checks"] if check["name"] not in (SLOW_ANSWERS, SAMPLE_TIMES)]
    again = judged(0, runs.recording(slug), "--spec", slug)
    for key in ("name", "outcome", "reason", "checks", "verdicts"):
        assert again[key] == test[key], key
    assert (again["notes"], again["clock"]) == ([], "lockstep")


def test_another_limit_gives_another_verdict(runs: Runs, tmp_path: Path) -> None:
    spec = changed(tmp_path, STRAIGHT, "max-time", "3 s")
    again = judged(1, runs.recording(STRAIGHT), "--spec", spec)
    assert again["reason"].startswith("did not reach finish within 3.00 s: the vehicle is at x = ")
    spec = changed(tmp_path, SIGNAL, "max-mean", "0.001")
    again = judged(1, runs.recording(SIGNAL), "--spec", spec)
    assert "the mean distance is " in again["reason"] and "(at most 0.001)" in again["reason"]
    assert [c["value"] for c in again["checks"]] == [c["value"] for c in runs.tests[SIGNAL]["checks"]]


def test_a_recording_of_another_test_is_told(runs: Runs) -> None:
    again = judged(3, runs.recording(STRAIGHT), "--spec", SIGNAL)
    assert f"the recording is of another test, {STRAIGHT}" in again["notes"]


def changed(folder: Path, name: str, parameter: str, value: str) -> Path:
    """A copy of a shipped test with another limit."""
    spec = folder / name / f"{name}.dodo.yml"
    spec.parent.mkdir()
    for common in ("maps", "targets"):
        shutil.copytree(REGISTRY / common, folder / common, dirs_exist_ok=True)
    text = (REGISTRY / name / f"{name}.dodo.yml").read_text()
    text, count = re.subn(rf"(?<={parameter}: )[^,}}\n]+", value, text)
    assert count == 1
    spec.write_text(text)
    return spec


CLOSED, PERCEPTION = "sil-closed-two-cars", "sil-perception-cars"
BLIND = (
    "perception.py",
    "        for colour, found in boxes.items()\n",
    "        for colour, found in [*boxes.items()][:-1]\n",
)


@pytest.mark.proof
def test_an_application_that_sees_no_car_fails(tmp_path: Path) -> None:
    application, report = kiwi(tmp_path / "app", BLIND), tmp_path / "report"
    dodo("run", CLOSED, PERCEPTION, "--application", str(application), "--report", str(report), code=1)
    found = results(report)
    assert found[CLOSED]["reason"].startswith("came within 0.097 m of body kiwi after 2.67 s at x = ")
    assert found[PERCEPTION]["reason"].startswith(
        "precision of car has no value (at least 0.7), because nothing was detected"
    )
