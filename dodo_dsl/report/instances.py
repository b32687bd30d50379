"""The instances of a matrix beside each other: a grid of parameters, in which one check is compared."""

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dodo_dsl.outcome import Outcome
from dodo_dsl.report import checks
from dodo_dsl.report.checks import Check

_CHOICE = re.compile(r"(?P<before>.*)\[(?P<choice>[^\[\]]+)\]")
_NEXT = re.compile(r",(?=[a-z][a-z0-9-]*=)")
_LONGEST_NAME = 1000
_MOST_GAPS = 4
"""Cells an outcome, of which a part may be empty if not all instances ran."""
_REPETITIONS = ("run", "report")
"""Dimensions whose first value is not written: ``--repeat`` and joined reports."""


class GridRow(NamedTuple):
    """The values of all dimensions but the column's, and the outcomes of each column."""

    values: Sequence[str]
    cells: Sequence[Sequence[Outcome]]


@dataclass(frozen=True)
class MatrixGrid:
    """A test's instances; ``column`` is the dimension of the columns, empty if there is but one dimension."""

    name: str
    dimensions: Sequence[str]
    column: str
    columns: Sequence[str]
    rows: Sequence[GridRow]


def grids(outcomes: Sequence[Outcome]) -> list[MatrixGrid]:
    """A grid a matrix with two instances or more, in the order of the outcomes."""
    found: dict[str, list[tuple[dict[str, str], Outcome]]] = defaultdict(list)
    for outcome in outcomes:
        name, choice = _parted(outcome.name)
        found[name].append((choice, outcome))
    return [grid for name, instances in found.items() for grid in _grid(name, instances)]


class Compared(NamedTuple):
    """The instances of a ``test`` by one check, the ``worst`` of them, and how many passed."""

    test: str
    check: str
    worst: Outcome
    passed: int
    number: int

    @property
    def choice(self) -> str:
        """``[light=dark]``"""
        return self.worst.name.removeprefix(self.test)

    def of(self, outcome: Outcome) -> Check | None:
        """The check of an instance, None if it has none."""
        return _check(outcome, self.check)

    def in_words(self) -> str:
        """``dil-course: 2 of 3 passed, worst is [recording=b.rec]: share 0.5 (at least 0.55)``"""
        check = self.of(self.worst)
        told = f": {checks.in_words(check)}" if check else ""
        return f"{self.test}: {self.passed} of {self.number} passed, worst is {self.choice}{told}"


def compared(outcomes: Sequence[Outcome]) -> list[Compared]:
    """Each matrix with two instances or more that have a check with a limit in common.

    The check is the test's headline, or else the one by which an instance is nearest to failing, or failed the most.
    """
    found: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        test, choice = _parted(outcome.name)
        if choice.keys() - set(_REPETITIONS):
            found[test].append(outcome)
    return [one for test, instances in found.items() for one in _compared(test, instances)]


def _compared(test: str, instances: Sequence[Outcome]) -> Iterator[Compared]:
    judged = [outcome for outcome in instances if outcome.outcome != "error"]
    each = [(outcome, check) for outcome in judged for check in outcome.checks]
    names = {check["name"] for _, check in each if checks.share(check)}
    names -= {check["name"] for outcome, check in each if checks.only_follows(check, outcome.checks)}
    names = {name for name in names if all(_check(outcome, name) for outcome in judged)}
    if len(instances) > 1 and names:
        headline = next((o.headline for o in judged if o.headline in names), "")
        name = headline or min(sorted(names), key=lambda name: min(_share(outcome, name) for outcome in judged))
        worst = min(judged, key=lambda outcome: _share(outcome, name))
        yield Compared(test, name, worst, sum(o.outcome == "passed" for o in instances), len(instances))


def _check(outcome: Outcome, name: str) -> Check | None:
    return next((check for check in outcome.checks if check["name"] == name), None)


def _share(outcome: Outcome, name: str) -> float:
    check = _check(outcome, name)
    return (check and checks.share(check)) or 1.0


def _parted(name: str) -> tuple[str, dict[str, str]]:
    """``test[light=dark,speed=2][run=2]`` in its name and choices."""
    parts: list[str] = []
    while len(name) <= _LONGEST_NAME and (match := _CHOICE.fullmatch(name)):
        parts[:0] = _NEXT.split(match["choice"])
        name = match["before"]
    return name, dict(part.partition("=")[::2] for part in parts)


def _grid(name: str, instances: Sequence[tuple[dict[str, str], Outcome]]) -> Iterator[MatrixGrid]:
    dimensions = list(dict.fromkeys(key for choice, _ in instances for key in choice))
    full = [({**{key: "1" for key in _REPETITIONS if key in dimensions}, **choice}, o) for choice, o in instances]
    if len(full) < 2 or not dimensions or any(len(choice) < len(dimensions) for choice, _ in full):
        return
    column = dimensions[-1] if len(dimensions) > 1 else ""
    others = [dimension for dimension in dimensions if dimension != column]
    columns = list(dict.fromkeys(choice.get(column, "") for choice, _ in full))
    cells: dict[tuple[str, ...], dict[str, list[Outcome]]] = defaultdict(lambda: defaultdict(list))
    for choice, outcome in full:
        cells[tuple(choice[key] for key in others)][choice.get(column, "")].append(outcome)
    if len(cells) * len(columns) > _MOST_GAPS * len(full):
        return  # no matrix, which has every combination
    rows = [GridRow(values, [row.get(value, []) for value in columns]) for values, row in cells.items()]
    yield MatrixGrid(name, others, column, columns if column else ["outcome"], rows)
