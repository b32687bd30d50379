"""The goals of a test in the units of its checks."""

import math
from dataclasses import dataclass
from fnmatch import fnmatchcase

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Entry, Mapping, Scalar
from dodo_dsl.spec import quantity
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.model import Goal

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


class _WrongGoal(Exception):
    """A goal with a problem, or one that the schema reports."""

    def __init__(self, *problems: Diagnostic) -> None:
        super().__init__()
        self.problems = problems


def resolved_goals(test: ResolvedTest) -> ResolvedGoals:
    """The goals of a test, in the order in which they are written."""
    goals: list[Goal] = []
    problems: list[Diagnostic] = []
    for name, entry in test.spec.goals.items():
        try:
            goals.append(_goal(test, name, entry))
        except _WrongGoal as wrong:
            problems.extend(wrong.problems)
    return ResolvedGoals(tuple(goals), tuple(problems))


def _goal(test: ResolvedTest, name: str, entry: Entry) -> Goal:
    unit = _unit(test, name, entry)
    if not isinstance(entry.value, Mapping):
        raise _WrongGoal
    zero, one = (_value(entry.value, key, unit) for key in ("zero", "one"))
    better, weight = (_scalar(entry.value, key) for key in ("better", "weight"))
    if better is None or better.text not in ("less", "more"):
        raise _WrongGoal
    if not (one < zero if better.text == "less" else one > zero):
        written = _scalar(entry.value, "one") or better
        message = f"'one' is {written.text}, expected {better.text} than 'zero', as {better.text} is better"
        raise _WrongGoal(Diagnostic(written.span, "goal-values", message))
    number = weight.value if weight else 1.0
    if isinstance(number, bool) or not isinstance(number, int | float) or not number > 0:
        raise _WrongGoal
    return Goal(name, zero, one, float(number))


def _unit(test: ResolvedTest, name: str, entry: Entry) -> str | None:
    """The unit of a check, None if no manifest has it; raises _WrongGoal."""
    known = dict(_OF_THE_TEST)
    judges = [service.manifest for service in test.services if _judges(service)]
    for manifest in judges:
        known.update(manifest.checks)
    unit = next((unit for pattern, unit in known.items() if fnmatchcase(name, pattern)), None)
    if unit is None and all(manifest.checks for manifest in judges):
        if not test.is_complete or not test.spec.is_whole:
            raise _WrongGoal  # a service that is not known may have the check
        hint = did_you_mean(name, known)
        raise _WrongGoal(Diagnostic(entry.key, "unknown-check", f"no evaluator of the test has a check '{name}'", hint))
    return unit


def _judges(service: ResolvedService) -> bool:
    """Whether it is an evaluator, or in a wrong layer, where it may be one."""
    return service.use.layer == "evaluation" or service.use.layer not in service.manifest.layers


def _scalar(goal: Mapping, key: str) -> Scalar | None:
    value = goal.get(key)
    return value if isinstance(value, Scalar) else None


def _value(goal: Mapping, key: str, unit: str | None) -> float:
    """A value in the check's unit; raises _WrongGoal."""
    written = _scalar(goal, key)
    if written is None or written.value is None:
        raise _WrongGoal
    if unit is None:
        return _bare(key, written)
    try:
        return float(quantity.convert(written.text, unit or quantity.SHARE))
    except quantity.QuantityError as error:
        raise _WrongGoal(Diagnostic(written.span, "wrong-unit", f"'{key}': {error}", error.hint)) from error


def _bare(key: str, written: Scalar) -> float:
    """A number of an evaluator that does not declare its units."""
    value = written.value
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    message = (
        f"'{key}': '{written.text}' is not a number, and its evaluator's manifest does not declare the check's unit"
    )
    hint = "write a bare number, or add 'checks' to the manifest"
    raise _WrongGoal(Diagnostic(written.span, "wrong-unit", message, hint))
