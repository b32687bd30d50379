"""Violations of schemas, in words and at their places."""

import pytest

from dodo_dsl import __version__
from dodo_dsl.spec.validation import validate
from tests.check import examples
from tests.source.nodes import mapping

ENTRIES = ", ".join(f"s{n}: {{uses: a}}" for n in range(101))
CASES = {
    "levl: sil": ("unknown-key", "unknown key 'levl'", "did you mean 'level'?"),
    "environment: {a: {}}": (
        "missing-key", "'a' has no key 'uses'", "The service's name as `dodo list --services` shows it.",
    ),
    "seed: one": ("wrong-type", "'seed' is a string, expected a whole number", ""),
    "description: 1.0": ("wrong-type", "'description' is a number, expected a string", 'write it in quotes: "1.0"'),
    "matrix: {a: 1}": ("wrong-type", "'a' is a whole number, expected a list", None),
    "action: [a]": (
        "wrong-type",
        "'action' is a list, expected a mapping (key: value)",
        "write 'key: value' in place of list items",
    ),
    "level:": ("wrong-value", None, None),
    "level: sill": ("wrong-value", "'sill' is not a value of 'level', expected sil, dil, hil", "did you mean 'sil'?"),
    "dodo: 2": (
        "wrong-value",
        f"the file is of language version 2, the installed DoDo {__version__} reads 1",
        "install a DoDo that reads version 2, or, if the number is a mistake, write 'dodo: 1'",
    ),
    "dodo: 0": ("wrong-value", "'dodo' is '0', expected 1", "write 'dodo: 1'"),
    "timeout: 60": ("wrong-unit", "'timeout': '60' has no unit, expected a time in s", "write for example '60 s'"),
    "timeout: 60 m": ("wrong-unit", None, "write for example '60 s'"),
    "response: {over: 5 %}": ("missing-key", "'response' has 'over' without 'max'", ""),
    "name: My Test": ("wrong-value", None, "for example 'my-test'"),
    "seed: -1": ("out-of-range", "'seed' is -1, expected 0 to 4294967295", ""),
    f"seed: {'9' * 5000}": ("wrong-type", "'seed' has 5000 digits, expected a whole number", ""),
    "description: ''": ("missing-key", "'description' is empty, expected a string", ""),
    "evaluation: {}": ("missing-key", "'evaluation' is empty, expected at least one entry", ""),
    f"action: {{{ENTRIES}}}": ("too-large", "'action' has 101 entries, expected at most 100", ""),
    "description: !!binary abc": ("yaml-tag", "tag '!!binary' is not supported", None),
}  # fmt: skip


def spec(line: str) -> str:
    key = line.partition(":")[0]
    return examples.with_keys_of(examples.EXAMPLE, f"{line}\n") if key != "dodo" else f"{line}\n{examples.SPEC[8:]}"


@pytest.mark.parametrize("line", CASES, ids=lambda line: line[:20])
def test_violations(line: str) -> None:
    rule, message, hint = CASES[line]
    found = validate(mapping(spec(line)), "dodo")
    assert [problem.rule for problem in found] == [rule]
    assert message in (None, found[0].message)
    assert hint in (None, found[0].hint)


def test_a_valid_spec() -> None:
    assert validate(mapping(examples.SPEC), "dodo") == []


def test_places() -> None:
    node = mapping("dodo: 1\nregistry: [a, 3]\nrigs: {Kiwi: {kind: static, cid: 121}}\nother: 1\n")
    found = {problem.rule: (problem.span.line, problem.span.column) for problem in validate(node, "deployment")}
    assert found == {"wrong-type": (2, 15), "wrong-value": (3, 8), "unknown-key": (4, 1)}
