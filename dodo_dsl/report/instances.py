"""The instances and repetitions of a test together: how many passed, and which came closest to failing."""

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dodo_dsl.outcome import Outcome, worst_margin
from dodo_dsl.report import checks
from dodo_dsl.report.checks import Check

_URGENCIES = ("failed", "error", "passed")
_CHOICE = re.compile(r"\[([^\[\]]+)\]")
_NEXT = re.compile(r",(?=[a-z][a-z0-9-]*=)")
_MOST_GAPS = 4
"""Cells an outcome, of which a part is empty if not all instances ran."""


class Grid(NamedTuple):
    """Outcomes by parameters: those of ``names`` are the rows, ``column`` the columns, empty if there is but one."""

    names: Sequence[str]
    column: str
    values: Sequence[str]
    """Of the columns."""
    rows: Mapping[tuple[str, ...], Mapping[str, Sequence[Outcome]]]
    """Each row's values, and its outcomes by the value of the column."""


@dataclass(frozen=True)
class Family:
    """All instances and repetitions of one test; many tests have but one."""

    name: str
    outcomes: Sequence[Outcome]

    @property
    def urgency(self) -> int:
        """0 for what is looked at first."""
        return min(_URGENCIES.index(outcome.outcome) for outcome in self.outcomes)

    def count(self, kind: str) -> int:
        """How many of its tests have an outcome."""
        return sum(o.outcome == kind for o in self.outcomes)

    def worst(self) -> tuple[Outcome, Check] | None:
        """The one closest to failing with the check by which it is, of those that all have with a limit.

        The check is the test's headline, or else the one by which an instance is closest to failing. Of several that
        it makes equal, as those that hit a wall, the one of the worst margin.
        """
        judged = [outcome for outcome in self.outcomes if outcome.outcome != "error"]
        each = [(outcome, check) for outcome in judged for check in outcome.checks]
        names = {check["name"] for _, check in each if checks.share(check)}
        names -= {check["name"] for outcome, check in each if checks.only_follows(check, outcome.checks)}
        names = {name for name in names if all(check_of(outcome, name) for outcome in judged)}
        if len(self.outcomes) == 1 or not names:
            return None
        headlines = {o.headline for o in judged} & names
        shares = ((_share(outcome, name), name, outcome) for name in sorted(headlines or names) for outcome in judged)
        _, name, outcome = min(shares, key=lambda each: (*each[:2], worst_margin(each[2]) or 0.0))
        check = check_of(outcome, name)
        return None if check is None else (outcome, check)

    def grid(self) -> Grid | None:
        """None where many combinations of values are missing. The first of repetitions has no number."""
        parts = [[_NEXT.split(choice) for choice in _CHOICE.findall(outcome.name)] for outcome in self.outcomes]
        choices = [dict(part.partition("=")[::2] for choice in each for part in choice) for each in parts]
        names = list(dict.fromkeys(name for choice in choices for name in choice))
        column = names.pop() if len(names) > 1 else ""
        rows: dict[tuple[str, ...], dict[str, list[Outcome]]] = defaultdict(lambda: defaultdict(list))
        for choice, outcome in zip(choices, self.outcomes, strict=True):
            rows[tuple(choice.get(name, "1") for name in names)][choice.get(column, "1")].append(outcome)
        values = list(dict.fromkeys(value for row in rows.values() for value in row))
        is_matrix = names and len(rows) * len(values) <= _MOST_GAPS * len(self.outcomes)
        return Grid(names, column, values, rows) if is_matrix else None

    def in_words(self) -> str:
        """``dil-course: 2 of 3 passed, worst is [recording=b.rec]: share 0.5 (at least 0.55)``"""
        told = f"{self.name}: {self.count('passed')} of {len(self.outcomes)} passed"
        if not (worst := self.worst()):
            return told
        outcome, check = worst
        return f"{told}, worst is {outcome.name.removeprefix(self.name) or 'the first'}: {checks.in_words(check)}"


def families(outcomes: Sequence[Outcome]) -> list[Family]:
    """In the order of the outcomes."""
    found: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        found[outcome.name.partition("[")[0]].append(outcome)
    return [Family(name, members) for name, members in found.items()]


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """A line a test with several instances or repetitions."""
    return [family.in_words() for family in families(outcomes) if len(family.outcomes) > 1]


def check_of(outcome: Outcome, name: str) -> Check | None:
    return next((check for check in outcome.checks if check["name"] == name), None)


def _share(outcome: Outcome, name: str) -> float:
    check = check_of(outcome, name)
    return (check and checks.share(check)) or 1.0
