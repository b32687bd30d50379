"""The goals of a test in the units of its checks."""

from dataclasses import dataclass
from fnmatch import fnmatchcase

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Entry, Mapping, Scalar, plain
from dodo_dsl.spec.model import Goal
from dodo_dsl.spec.quantity import SHARE, QuantityError, convert

_OF_THE_TEST = {
    "slow-answers": "",
    "uncopied-sample-times": "",
    "peak-memory-*": "MB",
    "memory-growth-*": "MB/min",
    "processor-time-*": "s",
    "processor-share-*": "",
}
"""Checks of no evaluator."""


@dataclass(frozen=True)
class ResolvedGoals:
    """The goals that can be understood, and the problems of the others."""

    goals: tuple[Goal, ...]
    problems: tuple[Diagnostic, ...]


def resolved_goals(test: ResolvedTest) -> ResolvedGoals:
    """The goals of a test, in the order in which they are written."""
    found = [_goal(test, name, entry) for name, entry in test.spec.goals.items()]
    goals = tuple(goal for goal in found if isinstance(goal, Goal))
    return ResolvedGoals(goals, tuple(problem for problem in found if isinstance(problem, Diagnostic)))


def _goal(test: ResolvedTest, name: str, entry: Entry) -> Goal | Diagnostic | None:
    """A goal or its problem; None if a key is not valid, or a service that is not known may have the check."""
    unit, written = _unit(test, name), plain(entry.value)
    if unit is None and test.is_complete:
        hint = did_you_mean(name, _units(test))
        return Diagnostic(entry.key, "unknown-check", f"no evaluator of the test has a check '{name}'", hint)
    if unit is None or not {"better", "zero", "one"} <= written.keys():
        return None
    scalars = {k: e.value for k, e in entry.value.entries.items()} if isinstance(entry.value, Mapping) else {}
    values = {}
    for key in ("zero", "one"):
        scalar = scalars[key]
        assert isinstance(scalar, Scalar)
        try:
            values[key] = float(convert(scalar.text, unit or SHARE))
        except QuantityError as error:
            return Diagnostic(scalar.span, "wrong-unit", f"'{key}': {error}", error.hint)
    better = written["better"]
    if not (values["one"] < values["zero"] if better == "less" else values["one"] > values["zero"]):
        message = f"'one' is {written['one']}, expected {better} than 'zero', as {better} is better"
        return Diagnostic(scalars["one"].span, "goal-values", message)
    return Goal(name, **values, weight=float(written.get("weight", 1)))


def _units(test: ResolvedTest) -> dict[str, str]:
    """Those of all checks by name."""
    found = dict(_OF_THE_TEST)
    for service in test.services:
        found.update(service.manifest.checks)
    return found


def _unit(test: ResolvedTest, name: str) -> str | None:
    """The unit of a check, None if no manifest has it."""
    return next((unit for pattern, unit in _units(test).items() if fnmatchcase(name, pattern)), None)
