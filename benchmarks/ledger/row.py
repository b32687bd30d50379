"""What a benchmark found of one thing, round by round, as a line of JSON in the file that the ledger reads."""

import json
import os
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

FILE_VARIABLE = "DODO_BENCH_ROWS"
NOT_REACHED = "no time was left for it"
MOST_LETTERS = 300
"""Of the reason why a benchmark failed."""


@dataclass(frozen=True)
class Goal:
    """A limit of the median ratio, which is to be reached, or of our own median value, if there is no peer for it.

    ``quartile`` is what the lower quartile of the ratios has to exceed.
    """

    limit: float
    of: str = "ratio"  # or "value"
    quartile: float | None = None


@dataclass(frozen=True)
class Row:
    """``ours`` and ``theirs`` in ``unit``, and ``ratios``: how many times as good as the peer, in each round.

    ``less`` means that less of the unit is better, as of seconds. A row without ``ours`` was not measured, and one
    without ``theirs`` has no peer; ``note`` gives the reason.
    """

    what: str
    unit: str
    ours: tuple[float, ...] = ()
    peer: str = ""
    theirs: tuple[float, ...] = ()
    ratios: tuple[float, ...] = ()
    less: bool = False
    goal: Goal | None = None
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, found: dict[str, Any]) -> "Row":
        """Raises TypeError and ValueError for what is not a row."""
        goal = found.get("goal")
        numbers = {key: tuple(map(float, found.get(key, ()))) for key in ("ours", "theirs", "ratios")}
        return cls(**{**found, **numbers, "goal": Goal(**goal) if goal else None})


def rate_row(
    what: str, unit: str, ours: Iterable[float], peer: str = "", theirs: Iterable[float] = (), **rest: Any
) -> Row:
    """A row of rates: more is better. With a peer, each round has a value of both."""
    own, other = tuple(ours), tuple(theirs)
    ratios = tuple(a / b for a, b in zip(own, other, strict=True)) if other else ()
    return Row(what, unit, own, peer, other, ratios, **rest)


def cost_row(
    what: str, unit: str, ours: Iterable[float], peer: str = "", theirs: Iterable[float] = (), **rest: Any
) -> Row:
    """A row of times, sizes or shares: less is better. With a peer, each round has a value of both."""
    own, other = tuple(ours), tuple(theirs)
    ratios = tuple(b / a for a, b in zip(own, other, strict=True)) if other else ()
    return Row(what, unit, own, peer, other, ratios, less=True, **rest)


_measured: set[str] = set()
"""The rows with values that this process has reported."""


def report(*rows: Row) -> None:
    """Hands rows to the ledger, if it started this process; a later row of the same name replaces an earlier one."""
    _measured.update(row.what for row in rows if row.ours)
    name = os.environ.get(FILE_VARIABLE)
    if name:
        with Path(name).open("a") as file:
            file.writelines(json.dumps(row.to_json()) + "\n" for row in rows)


def plan(*rows: Row, note: str = NOT_REACHED) -> None:
    """Reports rows that a benchmark means to measure, with the reason if it does not come to them."""
    report(*(replace(row, note=note) for row in rows))


@contextmanager
def attempt(*planned: Row) -> Iterator[None]:
    """A part of a benchmark. If it fails, its rows that have no values say why, and what comes after it goes on."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the reason
        traceback.print_exc()
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        plan(*(row for row in planned if row.what not in _measured), note=reason[:MOST_LETTERS])


def read_rows(path: Path) -> list[Row]:
    """The last row of each name, in the order of the first; a line that was cut off is left out."""
    rows: dict[str, Row] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            row = Row.from_json(json.loads(line))
        except (ValueError, TypeError, AttributeError):
            continue
        rows[row.what] = row
    return list(rows.values())


def joined(parts: Sequence[Row]) -> Row:
    """One row of the rounds of several runs."""
    last = parts[-1]
    numbers = {
        key: tuple(value for part in parts for value in getattr(part, key)) for key in ("ours", "theirs", "ratios")
    }
    return Row(**{**vars(last), **numbers})
