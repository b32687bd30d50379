"""All rules over all instances: each problem once, with the instances that have it."""

from pathlib import Path

from tests.check.contexts import checked

MATRIX = """\
matrix: {{goal: [{goals}]}}
evaluation: {{track: {{uses: collision, with: {{goal: "${{matrix.goal}}"}}}}}}
"""


Found = list[tuple[str, int, tuple[str, ...]]]


def found(text: str, folder: Path) -> Found:
    """Rule, column and tests of what is wrong with the example."""
    problems = [d for d in checked(text, folder).diagnostics if d.span.file.endswith("example.dodo.yml")]
    return [(d.rule, d.span.column, d.tests) for d in problems]


def test_a_problem_of_some_instances_names_them(tmp_path: Path) -> None:
    assert found(MATRIX.format(goals="finish, a, b"), tmp_path) == [
        ("unknown-name", 52, ("example[goal=a]",)),
        ("unknown-name", 52, ("example[goal=b]",)),
    ]


def test_a_problem_of_all_instances_is_reported_once(tmp_path: Path) -> None:
    text = MATRIX.format(goals="finish, left") + "kind: closed-loop\nlevel: dil\n"
    assert [each for each in found(text, tmp_path) if each[0] == "level-kind"] == [("level-kind", 7, ())]


def test_the_ends_of_a_range_are_checked_where_they_are_written(tmp_path: Path) -> None:
    text = """\
vary: {goal: {among: [finish, end], nominal: finish}, freq: {from: 10 Hz, to: 2 kHz, nominal: 1 kHz}}
evaluation: {track: {uses: collision, with: {goal: "${vary.goal}"}}}
action: {vehicle: {uses: dynamic-model, with: {freq: "${vary.freq}"}}, pose: {uses: integrator}}
"""
    assert found(text, tmp_path) == [("unknown-name", 31, ()), ("out-of-range", 79, ())]


def test_a_problem_elsewhere_at_an_end_names_the_values(tmp_path: Path) -> None:
    text = """\
matrix: {yaw: [80 deg, 90 deg]}
vary: {sender: {among: [0, 3], nominal: 0}}
action:
  vehicle: {uses: dynamic-model, with: {frame-id: "${vary.sender}"}}
  pose: {uses: integrator, with: {yaw: "${matrix.yaw}"}}
"""
    assert found(text, tmp_path) == [("no-producer", 3, ("example[yaw=80 deg,sender=3]",))]


def test_a_test_without_problems(tmp_path: Path) -> None:
    assert found(MATRIX.format(goals="finish"), tmp_path) == []


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
        ("name-taken", "example.dodo.yml"),
    ]
