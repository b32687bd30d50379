"""What a hint about a wrong value says to write is allowed there."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import parse
from dodo_dsl.spec.schema_errors import schema_of
from dodo_dsl.spec.validation import validate
from tests.spec.schema.test_unknown_keys import Step, shown

WRONG = (
    "true",
    "12",
    "1.10",
    "~",
    '"12"',
    '"-3"',
    "yes",
    "1,5 s",
    "12 s",
    "text",
    "Two Words",
    "'a, b'",
    "{a: 1}",
    "[a]",
)
FORMS = (
    r'write it in quotes: (?P<v>".*")',
    r"write (?P<v>.+), without quotation marks",
    r"write (?:for example )?[\w-]+: (?P<v>\[.*\])",
    r"write '[\w-]+: (?P<v>[^']+)'(, .*)?",
    r"write (?:for example )?'(?P<v>[^']+)'(, .*)?",
    r"write (?P<v>true|false)",
    r"for example '(?P<v>[^']+)'",
    r"did you mean '(?P<v>[^']+)'(?: or .*)?\?",
)
"""Hints with a value; others are sentences."""


def leaves(
    schema: Any, root: Any, path: tuple[Step, ...] = (), seen: set[int] | None = None
) -> Iterator[tuple[Step, ...]]:
    """The paths of everything that a schema allows, of what several share the first."""
    seen = set() if seen is None else seen
    if not isinstance(schema, dict) or id(schema) in seen:
        return
    seen.add(id(schema))
    if "$ref" in schema:
        yield from leaves(root["$defs"][schema["$ref"].rpartition("/")[2]], root, path, seen)
    yield path
    for key, below in schema.get("properties", {}).items():
        yield from leaves(below, root, (*path, key), seen)
    yield from leaves(schema.get("additionalProperties"), root, (*path, "a"), seen)
    yield from leaves(schema.get("items"), root, (*path, 0), seen)
    for part in (*schema.get("oneOf", ()), *schema.get("anyOf", ()), *schema.get("allOf", ())):
        yield from leaves(part, root, path, seen)


def text_of(path: tuple[Step, ...], value: str) -> str:
    inner: Any = "VALUE"
    for step in reversed(path):
        inner = [inner] if isinstance(step, int) else {step: inner}
    return yaml.safe_dump(inner).replace("VALUE", value)


def told(name: str, path: tuple[Step, ...], value: str) -> list[Diagnostic]:
    """What is said about the value, in its line, and about its items."""
    text = text_of(path, value)
    line = (
        text_of(path, "VALUE").splitlines().index(next(t for t in text_of(path, "VALUE").splitlines() if "VALUE" in t))
    )
    node, problems = parse(text, "a-test.dodo.yml")
    assert node is not None, problems
    rules = ("wrong-type", "wrong-value", "wrong-unit", "out-of-range")
    return [d for d in validate(node, name) if d.span.line == line + 1 and d.rule in rules]


def meant(hint: str) -> str | None:
    """The value of a hint as it is written in YAML."""
    found = next((match for form in FORMS if (match := re.fullmatch(form, hint))), None)
    return found["v"] if found else None


CASES = [
    (name, path)
    for name in ("dodo", "deployment", "machine", "service", "application")
    for schema in (schema_of(name),)
    for path in dict.fromkeys(leaves(schema, schema))
    if path
]


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "path"), CASES, ids=[f"{name} {shown(path)}" for name, path in CASES])
def test_what_a_hint_says_is_allowed(name: str, path: tuple[Step, ...]) -> None:
    for wrong in WRONG:
        for problem in told(name, path, wrong):
            value = meant(problem.hint)
            if value is not None:
                again = told(name, path, value)
                assert not again, (wrong, problem.message, problem.hint, again)


@pytest.mark.parametrize("value", ["true", "12", "My_Test", "1.10"])
def test_the_name_of_a_test_is_that_of_its_file(value: str) -> None:
    (problem,) = told("dodo", ("name",), value)
    assert problem.hint == "write 'name: a-test', as the file is called"


def test_a_choice_that_yaml_takes_for_a_number() -> None:
    (problem,) = told("service", ("parameters", "a", "unit"), "1")
    assert problem.hint == 'write it in quotes: "1"'


def test_a_text_that_yaml_takes_for_a_number_is_meant_as_it_is_written() -> None:
    (problem,) = told("deployment", ("images", "tag"), "1.10")
    assert problem.hint == 'write it in quotes: "1.10"'
