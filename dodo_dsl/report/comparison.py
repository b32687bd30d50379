"""Two reports compared: which tests changed sides, came or went, and how the checks of those in both changed.

A change is for the better or not by the side of its limit and the margin to it. Terminal, Markdown and the page show
the same sections. The Markdown is for the note of a merge request: short, and no text of others in it is markup.
"""

import errno
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome, differs_each_run, numbered
from dodo_dsl.report import checks
from dodo_dsl.report.checks import Check, number, value_text, with_margins
from dodo_dsl.report.results import GivenReport, distinct
from dodo_dsl.terminal import printable

NEGLIGIBLE = 0.01
"""Share by which a value may change without a word; counts differ from 1 on."""
Direction = Literal["worse", "better", "different", "unchanged"]
"""``different`` is a change of a value that has no limit, or whose limits say nothing of the direction."""
DIRECTIONS: tuple[Direction, ...] = ("worse", "better", "different")
"""Of changes that are shown."""


@dataclass(frozen=True)
class CheckChange:
    """A check of a test in both reports."""

    index: int
    """Of the check in the newer report's test."""
    before: Check
    after: Check

    @property
    def name(self) -> str:
        return str(self.after["name"])

    @property
    def is_crossing(self) -> bool:
        """Whether it is on the other side of its limit now."""
        return bool(self.before["ok"]) != bool(self.after["ok"])

    @property
    def direction(self) -> Direction:
        before, after = self.before, self.after
        if self.is_crossing:
            return "better" if after["ok"] else "worse"
        same_unit = _unit(before) == _unit(after)
        same_limit = (before.get("limit") or {}) == (after.get("limit") or {})
        alike = same_unit and same_limit and _is_alike(before["value"], after["value"])
        if alike or differs_each_run(after["name"]):
            return "unchanged"
        old, new = with_margins(before)["margin"], with_margins(after)["margin"]
        if not same_unit or old is None or new is None or old == new:
            return "different"
        return "better" if new > old else "worse"

    @property
    def difference(self) -> str:
        """``-0.07 m``; empty if there is none, or another unit."""
        before, after = self.before["value"], self.after["value"]
        if before is None or after is None or before == after or _unit(self.before) != _unit(self.after):
            return ""
        return f"{'+' * (after > before)}{value_text(after - before, _unit(self.after))}"

    def in_words(self) -> str:
        """``0.12 m -> 0.05 m (-0.07 m; limit: at least 0.03 m)``"""
        limit, old = (", ".join(checks.limits(check)) for check in (self.after, self.before))
        was = f", was {old or 'none'}" if limit != old else ""
        notes = [self.difference, f"limit: {limit or 'none'}{was}" if limit or was else ""]
        told = "; ".join(filter(None, notes))
        return f"{checks.measured(self.before)} -> {checks.measured(self.after)}{f' ({told})' if told else ''}"


def _unit(check: Check) -> str:
    return check.get("unit") or ""


def _is_alike(before: float | None, after: float | None) -> bool:
    if before is None or after is None or number(before) == number(after):
        return before is after or (before is not None and after is not None)
    are_counts = before == int(before) and after == int(after)
    return not are_counts and abs(after - before) <= NEGLIGIBLE * max(abs(before), abs(after))


Kind = Literal["newly failing", "still failing", "new", "gone", "fixed", "still passing"]
KINDS: tuple[Kind, ...] = ("newly failing", "still failing", "new", "gone", "fixed", "still passing")
"""The most urgent first."""


@dataclass(frozen=True)
class TestChange:
    """A test in two reports; None in the one without it."""

    __test__ = False  # no test of pytest

    before: Outcome | None
    after: Outcome | None

    @property
    def kind(self) -> Kind:
        if self.before is None or self.after is None:
            return "new" if self.before is None else "gone"
        if self.before.outcome == "passed":
            return "still passing" if self.after.outcome == "passed" else "newly failing"
        return "fixed" if self.after.outcome == "passed" else "still failing"

    @property
    def latest(self) -> Outcome:
        found = self.after or self.before
        assert found is not None
        return found

    @property
    def checks(self) -> list[CheckChange]:
        """Of those in both."""
        was, now = self._checks()
        return [CheckChange(index, was[key], now[key]) for index, key in enumerate(now) if key in was]

    def by_index(self) -> dict[int, CheckChange]:
        return {change.index: change for change in self.checks}

    def in_words(self) -> str:
        """``passed -> failed, hit wall right``"""
        outcomes = dict.fromkeys(o.outcome for o in (self.before, self.after) if o is not None)
        return f"{' -> '.join(outcomes)}, {checks.title(self.latest)}"

    def other_checks(self) -> str:
        """``new check gates; check speed is gone``, if it is in both."""
        was, now = self._checks() if self.before and self.after else ({}, {})
        more = [f"new check {name}" for name, n in now if (name, n) not in was]
        return "; ".join([*more, *(f"check {name} is gone" for name, n in was if (name, n) not in now)])

    def _checks(self) -> tuple[Mapping[tuple[str, int], Any], Mapping[tuple[str, int], Any]]:
        was, now = (numbered(outcome.checks) if outcome else {} for outcome in (self.before, self.after))
        return was, now


class Change(NamedTuple):
    """What changed of a test, in words; ``slug`` is empty for one that is gone."""

    slug: str
    test: str
    words: str


@dataclass(frozen=True)
class Comparison:
    """All tests of two reports, in the order of the newer one, those that are gone last."""

    other: str
    """The file of the older report."""
    tests: Sequence[TestChange]

    def by_slug(self) -> dict[str, TestChange]:
        """The tests of the newer report."""
        return {test.after.slug: test for test in self.tests if test.after}

    def of(self, direction: Direction) -> list[tuple[TestChange, CheckChange]]:
        """The checks that changed so, those that crossed their limits first."""
        found = [(test, check) for test in self.tests for check in test.checks if check.direction == direction]
        return sorted(found, key=lambda pair: not pair[1].is_crossing)

    def sections(self) -> Iterator[tuple[str, list[Change]]]:
        """What to show, the most urgent first, by the kind of change: tests, then checks."""
        for kind in KINDS[:-1]:
            tests = [test for test in self.tests if test.kind == kind]
            yield kind, [Change(t.after.slug if t.after else "", t.latest.name, t.in_words()) for t in tests]
        yield "other checks", [Change(t.latest.slug, t.latest.name, w) for t in self.tests if (w := t.other_checks())]
        for direction in DIRECTIONS:
            pairs = self.of(direction)
            yield direction, [Change(t.latest.slug, t.latest.name, f"{c.name}: {c.in_words()}") for t, c in pairs]

    def in_words(self) -> str:
        """How many tests there are of each kind, as ``2 newly failing, 14 still passing``."""
        counts = Counter(test.kind for test in self.tests)
        return ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind]) or "no tests"


def compare(outcomes: Sequence[Outcome], other: GivenReport) -> Comparison:
    """Tests are the same where their slugs are."""
    old = {test.outcome.slug: test.outcome for test in distinct([other])}
    new = {outcome.slug: outcome for outcome in outcomes}
    tests = [TestChange(old.get(slug), outcome) for slug, outcome in new.items()]
    return Comparison(str(other.file), [*tests, *(TestChange(o, None) for slug, o in old.items() if slug not in new)])


FILE_NAME = "changes.md"
MOST_LINES = 60
_MARK = "<!-- written by dodo report -->"
"""The first line, by which the file is known as one of DoDo."""
_MOST_TEXT = 300


def to_markdown(comparison: Comparison, matrices: Sequence[str] = ()) -> str:
    """At most ``MOST_LINES`` lines, the most urgent first; ``matrices`` says how the instances of each did."""
    lines = [_MARK, f"**DoDo:** {comparison.in_words()}, compared with {code(comparison.other)}"]
    sections = [(title, [f"{code(c.test)}: {code(c.words)}" for c in found]) for title, found in comparison.sections()]
    for title, items in [*sections, ("matrices", [code(line) for line in matrices])]:
        lines += ["", f"**{title.capitalize()} ({len(items)})**", *(f"- {item}" for item in items)] if items else []
    more = len(lines) - MOST_LINES + 1
    return "\n".join(lines if more <= 1 else [*lines[: MOST_LINES - 1], f"- and {more} lines more"]) + "\n"


def write_markdown(folder: Path, comparison: Comparison | None, matrices: Sequence[str] = ()) -> None:
    """Writes the Markdown into a report, or without a comparison removes that of an earlier one; raises OSError."""
    path = folder / FILE_NAME
    is_there = path.is_symlink() or path.exists()
    if is_there and not _is_ours(path):
        if comparison is not None:
            raise atomic.NotReplaceable(errno.EEXIST, "not written by DoDo; nothing is replaced", str(path))
    elif comparison is not None:
        atomic.write_text(path, to_markdown(comparison, matrices))
    elif is_there:
        path.unlink()


def code(text: str) -> str:
    """Text of others as code: one line in which nothing is a link, a mention, a command or the end of the code."""
    line = printable(text[:_MOST_TEXT]) + ("…" if len(text) > _MOST_TEXT else "")
    return f"`{line.replace('`', chr(0x2BC)) or ' '}`"


def _is_ours(path: Path) -> bool:
    try:
        return not path.is_symlink() and regular_file.text(path).startswith(_MARK)
    except (OSError, ValueError):
        return False


def change_lines(comparison: Comparison) -> Iterator[str]:
    """A line a test that does not pass as before, one a check whose value changed, and a count of the rest."""
    yield f"compared with {printable(comparison.other)}: {comparison.in_words()}"
    for title, found in comparison.sections():
        shown = title.upper() if title in KINDS else title
        yield from (f"  {shown:13}  {printable(change.test)}  {printable(change.words)}" for change in found)
    unchanged = len(comparison.of("unchanged"))
    yield f"  {unchanged} {'check' if unchanged == 1 else 'checks'} unchanged"
