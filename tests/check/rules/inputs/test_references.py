"""Entries of files that values name, and timeouts that evaluators need."""

import json
from pathlib import Path

import pytest

from dodo_dsl.check.file_rules import check_references
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
