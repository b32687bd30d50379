"""The ledger as a table in Markdown, whose columns are aligned, so that it reads as well in a terminal."""

from collections.abc import Sequence

from benchmarks.ledger.compare import Change
from benchmarks.ledger.ledger import Bench, Ledger
from benchmarks.ledger.row import Row
from benchmarks.ledger.spread import Spread

HEAD = ("what", "ours", "peer", "theirs", "ratio", "quartiles", "rounds", "goal", "met", "note")
CHANGES = ("what", "before", "quartiles", "after", "quartiles", "result")


def number(value: float) -> str:
    """Three digits that count."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def measured(row: Row) -> Spread | None:
    """What the goal is about, or else the ratio, or else the value."""
    is_value = row.goal is not None and row.goal.of == "value"
    values = row.ours if is_value or not row.ratios else row.ratios
    return Spread.of(values) if values else None


def is_met(row: Row) -> bool | None:
    """None if there is no goal, or nothing was measured that it is about."""
    goal = row.goal
    values = () if goal is None else row.ratios if goal.of == "ratio" else row.ours
    if goal is None or not values:
        return None
    found = Spread.of(values)
    if goal.of == "value" and row.less:
        return found.middle <= goal.limit
    return found.middle >= goal.limit and (goal.quartile is None or found.low > goal.quartile)


def goal_text(row: Row) -> str:
    goal = row.goal
    if goal is None:
        return ""
    if goal.of == "value":
        return f"at {'most' if row.less else 'least'} {number(goal.limit)} {row.unit}".rstrip()
    rest = "" if goal.quartile is None else f", lower quartile above {number(goal.quartile)}"
    return f"at least {number(goal.limit)}{rest}"


def ledger_table(ledger: Ledger) -> str:
    """Machine and load, all rows, and what ended badly or was left out."""
    rows = ledger.rows()
    loads = [load for bench in ledger.benches for load in bench.load]
    span = f"{min(loads):.1f} to {max(loads):.1f}" if loads else "unknown"
    m = ledger.machine
    lines = [
        f"Commit {ledger.commit}, {ledger.at}, {sum(b.seconds for b in ledger.benches):.0f} s",
        f"on {m.processor}, {m.cores} cores, {m.memory_gb:.0f} GB, {m.system}, Python {m.python}; load {span}",
        "",
        *aligned(HEAD, [_cells(row) for row in rows.values()]),
    ]
    notes = [f"- {bench.trouble}: {bench.name}" for bench in ledger.benches if bench.trouble and is_news(bench)]
    return "\n".join([*lines, *([""] if notes else []), *notes]) + "\n"


def is_news(bench: Bench) -> bool:
    """Whether no row says the benchmark's trouble."""
    return bench.trouble not in {row.note for row in bench.rows}


def change_table(changes: Sequence[Change], before: str, after: str) -> str:
    """Rows that two commits have in common."""
    cells = [(c.what, *_spread(c.before), *_spread(c.after), c.verdict) for c in changes]
    return "\n".join([f"{after} against {before}", "", *aligned(CHANGES, cells)]) + "\n"


def aligned(head: Sequence[str], cells: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table; its last column is as wide as its head, as sentences may be in it."""
    widths = [max(len(row[column]) for row in (head, *cells)) for column in range(len(head) - 1)]
    widths.append(len(head[-1]))
    lines = [" | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (head, *cells)]
    return [f"| {lines[0]} |", f"|{'|'.join('-' * (width + 2) for width in widths)}|", *(f"| {s} |" for s in lines[1:])]


def _cells(row: Row) -> tuple[str, ...]:
    met = is_met(row)
    spread = measured(row)
    return (
        row.what,
        f"{number(Spread.of(row.ours).middle)} {row.unit}" if row.ours else "not measured",
        row.peer,
        f"{number(Spread.of(row.theirs).middle)} {row.unit}" if row.theirs else "",
        number(Spread.of(row.ratios).middle) if row.ratios else "",
        _spread(spread)[1] if spread else "",
        str(spread.rounds) if spread else "",
        goal_text(row),
        "" if row.goal is None else "unknown" if met is None else "yes" if met else "no",
        " ".join(row.note.replace("|", "/").split()),
    )


def _spread(spread: Spread) -> tuple[str, str]:
    return number(spread.middle), f"{number(spread.low)} to {number(spread.high)}"
