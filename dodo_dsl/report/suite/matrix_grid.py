"""The instances of one matrix as a grid: parameters by outcome and the value that decided."""

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dodo_dsl.outcome import Outcome, differs_each_run
from dodo_dsl.report.changes import words
from dodo_dsl.report.changes.check_change import with_margins
from dodo_dsl.report.check_words import only_follows

_CHOICE = re.compile(r"(?P<before>.*)\[(?P<choice>[^\[\]]+)\]")
_NEXT = re.compile(r",(?=[a-z][a-z0-9-]*=)")
_LONGEST_NAME = 1000
_MOST_GAPS = 4
"""Cells an outcome, of which a part may be empty where not all instances ran."""
_REPETITIONS = ("run", "report")
"""Dimensions whose first value is not written: ``--repeat`` and joined reports."""


class GridRow(NamedTuple):
    """The values of all dimensions but the column's, and the outcomes of each column."""

    values: Sequence[str]
    cells: Sequence[Sequence[Outcome]]


@dataclass(frozen=True)
class MatrixGrid:
    """A test's instances; ``column`` is the dimension of the columns, empty where there is but one dimension."""

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
    checks = outcome.checks
    failed = [check for check in checks if not check["ok"] and not only_follows(check, checks)]
    shares = (
        (with_margins(check)["margin_share"], check) for check in outcome.checks if not differs_each_run(check["name"])
    )
    judged = sorted(((share, check) for share, check in shares if share), key=lambda pair: pair[0])
    found = failed or [check for _, check in judged]
    return f"{found[0]['name']} {words.value(found[0]['value'], found[0].get('unit') or '')}" if found else ""


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
