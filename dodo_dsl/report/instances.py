"""The instances of a matrix beside each other: a grid of parameters by outcome, and the worst of them."""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from dodo_dsl.outcome import Outcome, differs_each_run, worst_margin
from dodo_dsl.report import comparison
from dodo_dsl.report.comparison import only_follows, with_margins

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


def decisive_value(outcome: Outcome) -> str:
    """The first check that failed, or else the one with the least margin, with its value; empty without one.

    As for a test's margin, checks that cannot be better do not count.
    """
    check = decisive(outcome)
    return f"{check['name']} {comparison.value_text(check['value'], check.get('unit') or '')}" if check else ""


def decisive_limits(outcome: Outcome) -> str:
    """The limits of that check in words; empty without one."""
    check = decisive(outcome)
    return ", ".join(comparison.limits(check)) if check else ""


def decisive(outcome: Outcome) -> Mapping[str, Any] | None:
    """The check whose value ``decisive_value`` shows."""
    checks = outcome.checks
    failed = (check for check in checks if not check["ok"] and not only_follows(check, checks))
    judged = (c for c in map(with_margins, checks) if c["margin_share"] and not differs_each_run(c["name"]))
    return next(failed, None) or min(judged, key=lambda check: check["margin_share"], default=None)


class WorstInstance(NamedTuple):
    """The instance of a ``test`` that has the least margin, and how many of its ``number`` instances passed."""

    test: str
    outcome: Outcome
    passed: int
    number: int

    @property
    def choice(self) -> str:
        """``[light=dark]``"""
        return self.outcome.name.removeprefix(self.test)

    def in_words(self) -> str:
        """``dil-course: 2 of 3 passed, worst is [recording=b.rec]: share 0.5 (at least 0.55)``"""
        value, limits = decisive_value(self.outcome), decisive_limits(self.outcome)
        told = f": {value}{f' ({limits})' if limits else ''}" if value else ""
        return f"{self.test}: {self.passed} of {self.number} passed, worst is {self.choice}{told}"


def worst_instances(outcomes: Sequence[Outcome]) -> list[WorstInstance]:
    """The worst of each matrix with two instances or more, by margin; those in error have none and do not count."""
    found: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        test, choice = _parted(outcome.name)
        if choice.keys() - set(_REPETITIONS):
            found[test].append(outcome)
    return [worst for test, instances in found.items() for worst in _worst(test, instances)]


def _worst(test: str, instances: Sequence[Outcome]) -> Iterator[WorstInstance]:
    margins = [(margin, o) for o in instances if (margin := worst_margin(o)) is not None]
    if len(instances) > 1 and margins:
        _, worst = min(margins, key=lambda pair: pair[0])
        yield WorstInstance(test, worst, sum(o.outcome == "passed" for o in instances), len(instances))


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
