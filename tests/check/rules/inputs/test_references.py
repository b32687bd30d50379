"""Entries of files that values name, and timeouts that evaluators need."""

import json
from pathlib import Path

import pytest

from dodo_dsl.check import Rule
from dodo_dsl.check.file_rules import check_input, check_references, check_starts
from tests.check.contexts import context, found

GOAL = "evaluation: {track: {uses: collision, with: {goal: finnish}}}\n"


def test_an_entry_that_is_missing(tmp_path: Path) -> None:
    (problem,) = check_references(context(GOAL, tmp_path))
    assert (problem.rule, problem.message) == ("unknown-name", "'finnish' is not among the obstacles of plain/map.json")
    assert problem.hint == "did you mean 'finish'?"


def test_each_entry_of_a_list(tmp_path: Path) -> None:
    example = "evaluation: {track: {uses: collision, with: {goal: finish, walls: [a, finish, b]}}}\n"
    assert [message.split("'")[1] for _, message in found(check_references, example, tmp_path)] == ["a", "b"]


def test_walls_may_be_blocks_all_of_them_and_obstacles_without_a_name(tmp_path: Path) -> None:
    own = json.dumps({"obstacles": [{"lines": [0, 0, 1, 1]}], "block": [{"name": "hedge"}]})
    walls = "['*', blocks, hedge, obstacle-1, obstacle-2]"
    example = (
        f"evaluation: {{track: {{uses: collision, with: {{walls: {walls}}}}}}}\n# tests/maps/plain/map.json\n{own}\n"
    )
    message = "'obstacle-2' is not among the obstacles and blocks of plain/map.json"
    assert found(check_references, example, tmp_path) == [("unknown-name", message)]


@pytest.mark.parametrize("content", ["{", "[]", '{"obstacles": 3}'])
def test_a_file_that_has_no_entries_is_told_with_the_file(content: str, tmp_path: Path) -> None:
    assert found(check_references, f"{GOAL}# tests/maps/plain/map.json\n{content}\n", tmp_path) == []


def test_a_file_of_another_map(tmp_path: Path) -> None:
    other = json.dumps({"obstacles": [{"name": "finnish"}, {"other": 1}]})
    assert found(check_references, f"{GOAL}# tests/maps/plain/map.json\n{other}\n", tmp_path) == []


@pytest.mark.parametrize(("timeout", "rules"), [("40 s", ["short-timeout"]), ("1 min", [])])
def test_a_timeout_shorter_than_an_evaluator_waits(timeout: str, rules: list[str], tmp_path: Path) -> None:
    example = (
        f"timeout: {timeout}\nevaluation: {{track: {{uses: collision, with: {{goal: finish, max-time: 40 s}}}}}}\n"
    )
    problems = list(check_references(context(example, tmp_path)))
    assert [problem.rule for problem in problems] == rules
    assert all(problem.severity == "warning" for problem in problems)


@pytest.mark.parametrize(
    ("rule", "judge"),
    [
        (check_starts, "collision, with: {goal: finish, length: 36}"),
        (check_input, "responds, with: {message: opendlv.proxy.GroundSteeringRequest, freq: 10 Hz, max-time: 40}"),
    ],
)
def test_where_a_value_has_no_unit_nothing_else_is_told(rule: Rule, judge: str, tmp_path: Path) -> None:
    camera = "environment: {camera: {uses: virtual-camera, with: {map-path: ../maps/plain, freq: 10 Hz}}}"
    pose = "action: {pose: {uses: integrator, with: {x: 1 m, y: 1 m}}}"
    text = f"clock: lockstep\n{camera}\n{pose}\nevaluation: {{judge: {{uses: {judge}}}}}\n"
    assert found(rule, text, tmp_path) == []


SIGNAL = """
kind: open-loop
clock: {clock}
timeout: 90 s
environment:
  camera: {{uses: virtual-camera, with: {{map-path: ../maps/plain, freq: 10 Hz}}}}
  {source}
evaluation:
  judge:
    uses: continuous-signal
    with: {{message: opendlv.proxy.GroundSteeringRequest, field: groundSteering, target: ../t.csv, max-mean: 1{limits}}}
# tests/t.csv
time,value
{begin},0
{end},0
# tests/a.rec
any
"""
END = "path: {uses: beacon, with: {length: 1 m}}"
HOLD = "path: {uses: beacon, with: {length: 1 m, hold: true}}"
REPLAY = "drive: {uses: rec-replay, with: {rec: ../a.rec, name.argb: b.argb, name.i420: b.i420}}"


SHORT = "expects 10 answers, and what it judges has {} frames"
OWN_TIMES = "expects samples with times of the test, and frames of 'drive' keep those of the recording"


@pytest.mark.parametrize(
    ("source", "limits", "begin", "end", "problem", "severities"),
    [
        (END, "", 0, 0.5, SHORT.format(6), "ew"),
        (END, ", min-samples: 6", 0, 0.5, "", ""),
        (END, ", from: 2 s, until: 2.8 s", 0, 9, SHORT.format(9), "ew"),
        (END, "", 1.7e9, 1.7e9 + 9, "has nothing to judge: its target begins at 1,700,000,000 s", "ee"),
        (END, ", align: sample-time", 0, 9, "aligns by sample times, which count from 1970", "ee"),
        (END, ", max-gap: 50 ms", 0, 9, "expects an answer each 0.05 s, and frames come each 0.1 s", "ew"),
        (HOLD, "", 0, 89, "judges 60 s of the 90 s that it may take, as nothing ends the input", "ww"),
        (HOLD, ", max-time: 60 s", 0, 89, "", ""),
        (END, "", 0, 89, "", ""),
        (REPLAY, "", 0, 9, OWN_TIMES, "ew"),
        (REPLAY.replace("rec,", "rec, sample-times: test,"), "", 0, 9, "", ""),
    ],
)
def test_limits_that_the_input_cannot_meet(
    source: str, limits: str, begin: float, end: float, problem: str, severities: str, tmp_path: Path
) -> None:
    for clock, severity in zip(("lockstep", "realtime"), severities or "  ", strict=True):
        text = SIGNAL.format(clock=clock, source=source, limits=limits, begin=begin, end=end)
        (tmp_path / clock).mkdir()
        found = list(check_input(context(text, tmp_path / clock)))
        assert [each.severity[0] for each in found] == severity.split()
        for each in found:
            assert each.message.startswith(f"'judge' {problem}") and (each.rule, bool(each.hint)) == (
                "input-limit",
                True,
            )


@pytest.mark.parametrize(("least", "problem"), [(16, []), (17, ["'judge' " + SHORT.replace("10", "17").format(16)])])
def test_an_answer_counts_when_it_comes(least: int, problem: list[str], tmp_path: Path) -> None:
    text = SIGNAL.format(clock="lockstep", source=HOLD, limits="", begin=0, end=9)
    text = text.replace("target: ../t.csv, max-mean: 1", f"freq: 10 Hz, max-time: 1.5 s, min-frames: {least}")
    text = text.replace("continuous-signal", "responds")
    assert [each.message for each in check_input(context(text, tmp_path))] == problem


@pytest.mark.parametrize(("written", "rate"), [(", freq: 20 Hz", "20"), ("", "10")])
def test_frames_have_the_rate_of_the_camera_also_if_that_is_not_written(
    written: str, rate: str, tmp_path: Path
) -> None:
    text = SIGNAL.format(clock="lockstep", source=HOLD, limits="", begin=0, end=9).replace(", freq: 10 Hz", written)
    judge = next(each for each in context(text, tmp_path).services if each.use.name == "judge")
    assert judge.texts["freq"] == rate


def test_where_the_input_ends_by_itself_it_is_judged_for_the_tests_timeout(tmp_path: Path) -> None:
    for name, source, limit in (("a", END, "90"), ("b", HOLD, "60"), ("c", REPLAY, "90")):
        (tmp_path / name).mkdir()
        text = SIGNAL.format(clock="lockstep", source=source, limits="", begin=0, end=9)
        judge = next(each for each in context(text, tmp_path / name).services if each.use.name == "judge")
        assert judge.texts["max-time"] == limit
