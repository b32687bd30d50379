"""All rules over all instances: each problem once, with the instances that have it."""

from pathlib import Path

from dodo_dsl.check import check
from tests.check.contexts import checked

MATRIX = """\
matrix: {{goal: [{goals}]}}
evaluation: {{track: {{uses: collision, with: {{goal: "${{matrix.goal}}"}}}}}}
"""


def messages(goals: str, folder: Path) -> list[str]:
    found = checked(MATRIX.format(goals=goals), folder)
    problems = check(found.tests, found.manifests, found.deployment, found.application)
    return [problem.message for problem in problems[folder / "tests/example/example.dodo.yml"]]


def test_a_problem_of_some_instances_names_one(tmp_path: Path) -> None:
    message = "'{}' is not among the obstacles of plain/map.json (in example[goal={}])"
    assert messages("finish, a, b", tmp_path) == [message.format(goal, goal) for goal in "ab"]


def test_a_problem_of_all_instances_is_reported_once(tmp_path: Path) -> None:
    found = checked(MATRIX.format(goals="finish, left") + "kind: closed-loop\nlevel: dil\n", tmp_path)
    problems = check(found.tests, found.manifests, found.deployment, found.application)
    own = problems[tmp_path / "tests/example/example.dodo.yml"]
    assert [p.message for p in own if p.rule == "level-kind"] == [
        "a dil test cannot be closed-loop: a recording does not react to what the application does"
    ]


def test_a_test_without_problems(tmp_path: Path) -> None:
    assert messages("finish", tmp_path) == []
