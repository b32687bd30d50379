"""Tests resolved in memory, from what an example of the rule catalogue shows."""

from collections.abc import Iterable
from pathlib import Path

from dodo_dsl import compiler
from dodo_dsl.check.resolve import ResolvedTest, Rule, RuleContext
from dodo_dsl.compiler import Checked
from tests.check import examples


def checked(example: str, folder: Path) -> Checked:
    """The tests of a folder with an example's files."""
    examples.write(example, folder)
    return compiler.load([], start=folder)


def resolved(example: str, folder: Path) -> ResolvedTest:
    """The first instance of the example's test."""
    return _example(checked(example, folder).tests)


def context(example: str, folder: Path) -> RuleContext:
    """The input of a rule about that instance."""
    found = checked(example, folder)
    by_name = {test.spec.name or "": [test.spec] for test in found.tests}
    return RuleContext(_example(found.tests), found.manifests, by_name, found.deployment, found.application)


def found(rule: Rule, example: str, folder: Path) -> list[tuple[str, str]]:
    """The names and messages of what one rule finds."""
    return [(diagnostic.rule, diagnostic.message) for diagnostic in rule(context(example, folder))]


def _example(tests: Iterable[ResolvedTest]) -> ResolvedTest:
    return next(test for test in tests if test.spec.location.stem == "example")
