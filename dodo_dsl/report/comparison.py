"""Two reports compared: which tests changed sides, came or went, and how the checks of those in both changed.

A change is for the better or not by the side of its limit and the margin to it. Terminal and page show the same
sections.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

from dodo_dsl.outcome import Outcome, differs_each_run, numbered
from dodo_dsl.report import checks
from dodo_dsl.report.checks import Check, number, with_margins
from dodo_dsl.report.results import GivenReport, distinct
from dodo_dsl.terminal import printable

NEGLIGIBLE = 0.01
"""Share by which a value may change without a word; counts differ from 1 on."""
Direction = Literal["worse", "better", "different", "unchanged"]
"""``different`` is a change of a value that has no limit, or whose limits say nothing of the direction."""
KINDS = ("newly failing", "still failing", "new", "gone", "fixed", "still passing")
"""Of tests, the most urgent first."""


class Change(NamedTuple):
    """What changed of a test, in words; ``slug`` is empty for one that is gone."""

    slug: str
    test: str
    words: str


@dataclass(frozen=True)
class Comparison:
    """What changed since another report, of which ``other`` is the file."""

    other: str
    kinds: Mapping[str, str]
    """Of ``KINDS``, by the slugs of the newer report's tests."""
    sections: Mapping[str, Sequence[Change]]
    """What to show, the most urgent first, by the kind of change: tests, then checks."""
    unchanged: int
    """Checks."""

    def in_words(self) -> str:
        """``2 newly failing, 14 still passing``"""
        counts = Counter(self.kinds.values())
        return ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind]) or "no tests"


def compare(outcomes: Sequence[Outcome], other: GivenReport) -> Comparison:
    """Tests are the same where their slugs are; those that are gone come last."""
    old = {test.outcome.slug: test.outcome for test in distinct([other])}
    new = {outcome.slug: outcome for outcome in outcomes}
    found: dict[str, list[Change]] = {title: [] for title in (*KINDS, *get_args(Direction))}
    kinds = dict[str, str]()
    for slug in dict.fromkeys([*new, *old]):
        before, after = old.get(slug), new.get(slug)
        latest = after or old[slug]
        kinds[slug] = _kind(before, after)
        results = dict.fromkeys(outcome.outcome for outcome in (before, after) if outcome)
        words = f"{' -> '.join(results)}, {checks.title(latest)}"
        found[kinds[slug]].append(Change(slug if after else "", latest.name, words))
        if before and after:
            was, now = numbered(before.checks), numbered(after.checks)
            for key in (key for key in now if key in was):
                words = f"{key[0]}: {_values(was[key], now[key])}"
                found[direction(was[key], now[key])].append(Change(slug, latest.name, words))
    unchanged, _ = found.pop("unchanged"), found.pop("still passing")
    return Comparison(str(other.file), kinds, {title: each for title, each in found.items() if each}, len(unchanged))


def _kind(before: Outcome | None, after: Outcome | None) -> str:
    if before is None or after is None:
        return "new" if before is None else "gone"
    if before.outcome == "passed":
        return "still passing" if after.outcome == "passed" else "newly failing"
    return "fixed" if after.outcome == "passed" else "still failing"


def direction(before: Check, after: Check) -> Direction:
    """How a check of a test in both reports changed; crossing its limit comes first."""
    if bool(before["ok"]) != bool(after["ok"]):
        return "better" if after["ok"] else "worse"
    same_unit = (before.get("unit") or "") == (after.get("unit") or "")
    same_limit = (before.get("limit") or {}) == (after.get("limit") or {})
    alike = same_unit and same_limit and _is_alike(before["value"], after["value"])
    if alike or differs_each_run(after["name"]):
        return "unchanged"
    old, new = with_margins(before)["margin"], with_margins(after)["margin"]
    if not same_unit or old is None or new is None or old == new:
        return "different"
    return "better" if new > old else "worse"


def _is_alike(before: float | None, after: float | None) -> bool:
    if before is None or after is None or number(before) == number(after):
        return before is after or (before is not None and after is not None)
    are_counts = before == int(before) and after == int(after)
    return not are_counts and abs(after - before) <= NEGLIGIBLE * max(abs(before), abs(after))


def _values(before: Check, after: Check) -> str:
    """``0.12 m -> 0.05 m (limit: at least 0.03 m)``"""
    limit, old = (", ".join(checks.limits(check)) for check in (after, before))
    was = f", was {old or 'none'}" if limit != old else ""
    told = f" (limit: {limit or 'none'}{was})" if limit or was else ""
    return f"{checks.measured(before)} -> {checks.measured(after)}{told}"


def change_lines(comparison: Comparison) -> Iterator[str]:
    """A line a test that does not pass as before, one a check whose value changed, and a count of the rest."""
    yield f"compared with {printable(comparison.other)}: {comparison.in_words()}"
    for title, found in comparison.sections.items():
        shown = title.upper() if title in KINDS else title
        yield from (f"  {shown:13}  {printable(change.test)}  {printable(change.words)}" for change in found)
    yield f"  {comparison.unchanged} {'check' if comparison.unchanged == 1 else 'checks'} unchanged"
