"""Where the time of a run goes."""

import itertools
import json

import pytest

from benchmarks.pictures import run_trace
from tests.cli.run.test_command import Command, dodo
from tests.run.scripted import plan

__all__ = ["dodo"]


def test_phases_follow_one_another_and_those_of_tests_are_in_the_run(
    dodo: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    compiled = str(dodo.compiled(plan()))
    assert run_trace.main(["out.json", "--compiled", compiled, "--report", "report", "--repeat", "2"]) == 0
    lines = capsys.readouterr().out.partition("where the time went")[2].splitlines()
    assert [line.split("  ")[0] for line in lines[1:5]] == ["start and load", "compile", "run", "report"]
    events = json.loads((dodo.folder / "out.json").read_text())["traceEvents"]
    lanes = {event["tid"]: event["args"]["name"] for event in events if event["ph"] == "M"}
    spans = [event for event in events if event["ph"] == "X"]
    assert len(lanes) == 3 and spans[0]["ts"] == 0
    for lane in lanes:
        own = [span for span in spans if span["tid"] == lane]
        assert own and all(span["dur"] >= 0 for span in own)
        assert all(abs(b["ts"] - a["ts"] - a["dur"]) <= 1 for a, b in itertools.pairwise(own)), own
    whole = next(span for span in spans if span["name"] == "run")
    tests = [span for span in spans if lanes[span["tid"]] != run_trace.COMMAND]
    assert all(whole["ts"] <= s["ts"] and s["ts"] + s["dur"] <= whole["ts"] + whole["dur"] for s in tests)
