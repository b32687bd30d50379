"""Names of tests: their file's, no keyword, and unique."""

from dataclasses import replace
from pathlib import Path

from dodo_dsl.check.spec_rules import check_names
from dodo_dsl.spec.registry import KEYWORDS, Location
from tests.check.contexts import context, found


def test_the_name_of_the_file(tmp_path: Path) -> None:
    expected = [("name-differs", "the name 'other' differs from the file's name")]
    assert found(check_names, "name: other\n", tmp_path) == expected
    assert found(check_names, "name: example\n", tmp_path) == []


def test_a_keyword(tmp_path: Path) -> None:
    assert "pages" in KEYWORDS
    assert found(check_names, "name: pages\n", tmp_path)[0][0] == "name-reserved"


def test_a_name_that_another_file_has(tmp_path: Path) -> None:
    own = context("", tmp_path)
    other = replace(own.spec, location=Location(tmp_path / "more/example/example.dodo.yml", tmp_path / "more"))
    (problem,) = check_names(replace(own, by_name={"example": [own.spec, other]}))
    assert problem.rule == "name-taken"
    assert problem.message.endswith("more/example/example.dodo.yml")
