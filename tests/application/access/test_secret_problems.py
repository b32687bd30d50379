"""Warnings of variables that look like secrets."""

from pathlib import Path

import pytest

from dodo_dsl.application.access.secret_problems import in_file, left_out, withheld, written
from dodo_dsl.diagnostics import format_text
from tests.source.nodes import mapping

OUTSIDE = {"DATABASE": "x://a:s3cr3t@b", "DISPLAY": ":0", "HOME": "/root", "DODO_SEARCH_STORAGE": "x", "PWD": "/"}


def names(text: str, own: tuple[str, ...] = (), passed: tuple[str, ...] = ()) -> list[str]:
    """The variables that a compose file is warned of."""
    return [problem.message.split("'")[1] for problem in withheld([mapping(text)], own, passed, OUTSIDE)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("command: --a=${API_KEY} --b=$CI_X", ["API_KEY", "CI_X"]),
        ("command: ['${A:-${API_KEY}}', '${API_KEY}']", ["API_KEY"]),
        ("command: sh -c 'echo $${API_KEY}'", []),
        ("environment: [API_KEY, SPEED, A_TOKEN=1]", ["API_KEY"]),
        ("environment: {API_KEY: , A_TOKEN: x}", ["API_KEY"]),
        ("build: {args: [API_KEY]}", ["API_KEY"]),
        ("build: {args: {API_KEY: null}}", ["API_KEY"]),
        ("s: {environment: API_KEY}", ["API_KEY"]),
        ("x-own: ${API_KEY}", []),
        ("labels: [API_KEY]", []),
        ("environment: [DATABASE, DISPLAY, HOME, SPEED]", ["DATABASE", "DISPLAY"]),
        ("command: ${PWD}/x --a=${DISPLAY} --b=${DODO_SEARCH_STORAGE:-}", ["DISPLAY", "DODO_SEARCH_STORAGE"]),
    ],
)
def test_variables_that_are_named(text: str, expected: list[str]) -> None:
    assert names(text) == expected


def test_own_and_passed_variables_are_no_problem() -> None:
    assert names("command: $A_KEY $B_KEY $C_KEY", ("A_KEY",), ("B_KEY",)) == ["C_KEY"]


def test_values_that_look_like_secrets(tmp_path: Path) -> None:
    token = "glpat-" + "0123456789" * 2
    node = mapping(f"command: --db=x://a:s3cr3t@b\nenvironment: {{T: {token}, U: https://a.b/c, V: 'x://a:${{P}}@b'}}")
    found = list(written([node]))
    assert [problem.message.split(",")[0] for problem in found] == [
        "this looks like an address with a password",
        "this looks like a token",
    ]
    assert {problem.span.length for problem in found} == {0}
    file = tmp_path / "own.env"
    file.write_text(f"SPEED=1\nT={token}\n")
    (problem,) = in_file(file, raw=False)
    assert (problem.span.file, problem.span.line, problem.span.column) == (str(file), 2, 1)
    assert token not in format_text([problem])


def test_a_value_that_is_repeated_is_told_once() -> None:
    node = mapping("x-db: &db {DB: 'x://a:s3cr3t@b'}\na: {environment: *db}\nb: {environment: *db}")
    assert len(list(written([node, node]))) == 1


def test_lines_with_secrets_are_not_shown(tmp_path: Path) -> None:
    file = tmp_path / ".env"
    file.write_text("SPEED=1\nexport API_KEY=s3cr3t\nDB=x://a:s3cr3t@b\n")
    (problem,) = left_out({"API_KEY": file, "DB": file})
    assert (problem.span.line, problem.span.column, problem.severity) == (2, 8, "warning")
    assert "API_KEY, DB" in problem.message
    assert "s3cr3t" not in format_text([problem])
