"""All rules over all instances: each problem once, with the instances that have it."""

from pathlib import Path

from dodo_dsl.check import check
from tests.check.contexts import checked

MATRIX = """\
matrix: {{goal: [{goals}]}}
evaluation: {{track: {{uses: collision, with: {{goal: "${{matrix.goal}}"}}}}}}
"""


def messages(goals: str, folder: Path) -> list[str]:
    return [problem.sentence for problem in checked(MATRIX.format(goals=goals), folder).diagnostics]


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


def of_ranges(text: str, folder: Path) -> list[tuple[int, str]]:
    found = checked(text, folder)
    return [(d.span.column, d.sentence) for d in found.diagnostics if d.span.file.endswith("example.dodo.yml")]


def test_the_ends_of_a_range_are_checked_where_they_are_written(tmp_path: Path) -> None:
    text = """\
vary: {goal: {among: [finish, end], nominal: finish}, freq: {from: 10 Hz, to: 2 kHz, nominal: 1 kHz}}
evaluation: {track: {uses: collision, with: {goal: "${vary.goal}"}}}
action: {vehicle: {uses: dynamic-model, with: {freq: "${vary.freq}"}}, pose: {uses: integrator}}
"""
    assert of_ranges(text, tmp_path) == [
        (31, "'end' is not among the obstacles of plain/map.json"),
        (79, "parameter 'freq' is 2 kHz, expected 1 to 1000 Hz"),
    ]


def test_a_problem_elsewhere_at_an_end_names_the_values(tmp_path: Path) -> None:
    text = """\
matrix: {yaw: [80 deg, 90 deg]}
vary: {sender: {among: [0, 3], nominal: 0}}
action:
  vehicle: {uses: dynamic-model, with: {frame-id: "${vary.sender}"}}
  pose: {uses: integrator, with: {yaw: "${matrix.yaw}"}}
"""
    assert [message for _, message in of_ranges(text, tmp_path)] == [
        "'pose' needs opendlv.sim.KinematicState/0, which no service of the test sends "
        "(in example[yaw=80 deg,sender=3])",
    ]


def test_a_test_without_problems(tmp_path: Path) -> None:
    assert messages("finish", tmp_path) == []


def test_all_errors_in_one_run(tmp_path: Path) -> None:
    """One of a spec or the application hides no other, neither of names and paths nor of all tests together."""
    text = """\
timeout: 60 sx
isolation: host
matrix: {n: [1, 2, 3]}
evaluation: {driver: {uses: collision, with: {goal: finish}}}
# dodo.yml
cids: 128-129
# docker-compose.yml
services: {driver: {image: driver, command: --cid=111, env_file: gone.env}}
"""
    (tmp_path / "tests/maps/plain").mkdir(parents=True)
    (tmp_path / "tests/maps/plain/out").symlink_to("/etc/hostname")
    errors = [d for d in checked(text, tmp_path).diagnostics if d.severity == "error"]
    assert [(d.rule, Path(d.span.file).name) for d in errors] == [
        ("application-file", "docker-compose.yml"),
        ("out-of-cids", "dodo.yml"),
        ("path-escape", "base.dodo.yml"),
        ("path-escape", "example.dodo.yml"),
        ("wrong-unit", "example.dodo.yml"),
        ("service-taken", "example.dodo.yml"),
    ]
