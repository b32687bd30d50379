"""Whole tests in lockstep, with applications of all manners."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.drive.applications import ROOT, TOLD, dodo, kiwi, program, results
from tests.drive.variants import registry, variant

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
CURVE = "sil-closed-left-curve"


def application(folder: Path, script: str, command: str, **about: Any) -> Path:
    """A compose file for a script of this folder."""
    shutil.copy(HERE / script, folder)
    return program(folder, "python", script, command=command, **about)


def run(folder: Path, manner: str, code: int, *words: str) -> tuple[dict[str, Any], list[str]]:
    """What became of the test, and the pictures that the application saw."""
    folder.mkdir(exist_ok=True)
    path, report = application(folder, "manners.py", f"--manner={manner}"), folder / "report"
    dodo("run", CURVE, "--application", str(path), "--report", str(report), *words, code=code)
    log = (report / CURVE / "logs" / "application.app.log").read_text()
    return results(report)[CURVE], [line for line in log.splitlines() if line.startswith("picture")]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], list[str]]:
    """With an application that copies sample times and answers once; it hits a wall."""
    return run(tmp_path_factory.mktemp("plain"), "copies", 1)


def test_verdict_clock_and_test_time_are_in_the_results(plain: tuple[dict[str, Any], list[str]]) -> None:
    test, pictures = plain
    assert (test["outcome"], test["clock"]) == ("failed", "lockstep")
    assert test["reason"].startswith("hit wall ")
    assert test["sim_s"] > 1.0
    times = [int(picture.split()[1]) for picture in pictures]
    assert times == [1_700_000_000_000_000 + n * 100_000 for n in range(len(times))]
    assert test["sim_s"] * 10 - 1 <= len(pictures) <= test["sim_s"] * 10 + 1


@pytest.mark.proof
def test_manners_and_the_host_s_bus_change_neither_values_nor_pictures(
    plain: tuple[dict[str, Any], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own sample times, and new processes again and again, without namespaces."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    test, pictures = run(tmp_path, "own-times,restarts", 1, "--isolation", "host")
    known = min(len(pictures), len(plain[1]))
    assert (test["reason"], test["checks"]) == (plain[0]["reason"], plain[0]["checks"])
    assert pictures[:known] == plain[1][:known]
    assert known >= len(plain[1]) - 1, "the last picture is shown as the test ends"


def test_who_answers_no_more_drives_on_as_he_did(tmp_path: Path) -> None:
    """And the memory of the few pictures that it kept."""
    test, _ = run(tmp_path, "stops,leaks", 1)
    assert test["outcome"] == "failed" and test["reason"].startswith("hit wall")
    (use,) = test["resources"]
    assert use["peak_memory_bytes"] > 200e6


@pytest.mark.parametrize("clock", ["lockstep", pytest.param("realtime", marks=pytest.mark.realtime)])
def test_the_verdict_of_an_evaluator_ends_the_test(tmp_path: Path, clock: str) -> None:
    """The other judges the drive alone, and not what the vehicle does behind the finish line."""
    place, compose = registry(tmp_path), kiwi(tmp_path / "app")
    (place / "hold.csv").write_text("time,value\n0,0\n60,0\n")
    about = {"message": "opendlv.proxy.GroundSteeringRequest", "field": "groundSteering", "target": "../hold.csv"}
    judge = {"uses": "continuous-signal", "with": {**about, "max-mean": "0.5 rad"}}
    spec = variant(place, "sil-closed-straight", "sil-until", until="track", clock=clock, evaluation={"steady": judge})
    dodo("run", str(spec), "--application", str(compose), "--report", str(tmp_path / "report"), code=0)
    track, steady = results(tmp_path / "report")["sil-until"]["verdicts"]
    samples = re.search(r" over (\d+) samples", steady["reason"])
    assert track["reason"].startswith("reached") and samples and 54 <= int(samples[1]) <= 62


def test_of_several_programs_the_last_may_join_late(tmp_path: Path) -> None:
    """What the first one sends before the second one listens would be lost, and no frame answered."""
    joins = "    with Session(flags.cid) as session:\n        session.hear_only("
    path = kiwi(tmp_path / "late", ("steering.py", joins, f"    __import__('time').sleep(1)\n{joins}"))
    awaiting = path.read_text()
    path.write_text(awaiting.replace("--await-steering", ""))
    assert path.read_text() != awaiting
    dodo("run", "sil-closed-straight", "--application", str(path), "--report", str(tmp_path / "report"), code=0)


def test_libcluon_in_lockstep(tmp_path: Path) -> None:
    pytest.importorskip("pycluon")
    """It sees the camera, hears the vehicle's frames, and steers the car, the same way each time."""
    found = []
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = application(folder, "cluon_app.py", "--steering=0.12", **{"x-dodo": TOLD})
        report, spec = folder / "report", variant(registry(folder), CURVE, "told", pose="declared")
        dodo("run", str(spec), "--application", str(path), "--report", str(report), code=1)
        test = results(report)["told"]
        assert re.fullmatch("hit wall left .*; the application gets its true pose .*", test["reason"])
        log = (report / "told" / "logs" / "application.app.log").read_text()
        seen = [json.loads(line) for line in log.splitlines() if line.startswith("{")][
            :-1
        ]  # the last may be of the end
        assert [each["stamp"] for each in seen[:3]] == [1_700_000_000.1, 1_700_000_000.2, 1_700_000_000.3]
        assert all(each["valid"] and each["bytes"] == 640 * 480 * 4 and each["colours"] > 10 for each in seen)
        assert seen[-1]["frames"] - seen[0]["frames"] > 5 * (len(seen) - 1)
        found.append((test["reason"], test["checks"]))
    assert found[0] == found[1]


@pytest.mark.proof
@pytest.mark.parametrize("name", [CURVE, "sil-closed-two-cars"])
def test_repeated_under_load_it_is_the_same(name: str) -> None:
    """Verdict, way and pictures of a run alone and of one beside processes that take all of the processor."""
    command = [sys.executable, str(ROOT / "scripts" / "repeat-lockstep"), name, "2", "10"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=600)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "  0 burners  " in result.stdout and "  3 burners  " in result.stdout
    assert f"{name}: 2 of 2 runs gave " in result.stdout
