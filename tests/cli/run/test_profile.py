"""Where the time of a run goes."""

import itertools
import json
from pathlib import Path

import pytest

from dodo_dsl.cli.run import profile
from dodo_dsl.cli.run.profile import COMMAND, Profile
from tests.cli.run.test_command import ENDINGS, Command, dodo

__all__ = ["dodo"]


@pytest.mark.thorough
def test_a_run_shows_and_writes_its_phases(dodo: Command) -> None:
    dodo.stages = ENDINGS["passed"]
    code, out, _ = dodo.run("--repeat", "3", "--profile")
    assert code == 0
    lines = out.partition("where the time went")[2].splitlines()
    rows = [line.split("  ")[0] for line in lines[1:5]]
    assert rows == ["start and load", "compile", "run", "report"]
    assert "of 3 tests, the median" in lines and lines[-1] == "profile: report/profile.json"
    events = json.loads((dodo.folder / "report" / "profile.json").read_text())["traceEvents"]
    lanes = {event["tid"]: event["args"]["name"] for event in events if event["ph"] == "M"}
    spans = [event for event in events if event["ph"] == "X"]
    assert len(lanes) == 4 and {event["ph"] for event in events} == {"M", "X"}
    for lane, name in lanes.items():
        own = [span for span in spans if span["tid"] == lane]
        assert own and all(span["dur"] >= 0 for span in own)
        gaps = [after["ts"] - before["ts"] - before["dur"] for before, after in itertools.pairwise(own)]
        assert all(0 <= gap < 1_000_000 for gap in gaps), (name, own)
    run = next(span for span in spans if span["name"] == "run")
    of_tests = [span for span in spans if lanes[span["tid"]] != COMMAND]
    assert all(run["ts"] <= span["ts"] and span["ts"] + span["dur"] <= run["ts"] + run["dur"] for span in of_tests)


def test_without_the_option_nothing_is_shown(dodo: Command) -> None:
    dodo.stages = ENDINGS["passed"]
    _, out, _ = dodo.run()
    assert "where the time went" not in out and not (dodo.folder / "report" / "profile.json").exists()


def test_what_the_kernel_does_not_say_is_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(profile, "_STAT", tmp_path / "none")
    found = Profile()
    found.enter(COMMAND, "compile")
    found.leave(COMMAND)
    assert all(line.endswith("unknown") for line in list(found.table())[1:])
