"""Two reports compared: which tests changed sides, came or went, and how the checks of those in both changed.

A change is for the better or not by the side of its limit and the margin to it. Terminal, Markdown and the page have
the words for changes in common. The Markdown is for the note of a merge request: short, and no text of others in it is
markup. A test has one slug if several reports hold the same: retries, repetitions, or jobs that ran the same test.
What checks say elsewhere is here, too: what failed, and what only shows where a drive ended.
"""

import errno
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome, differs_each_run, numbered, with_margin
from dodo_dsl.report.results import GivenReport
from dodo_dsl.terminal import printable

_OF_THE_WAY = ("time-to-goal", "to-goal", "gates")
"""What a drive that ends early leaves undone."""
_ENDING = ("wall-margin", "body-margin", "max-speed", "silence")
"""What ends it early."""
_WORDS = {"min": ("at least", "more than"), "max": ("at most", "less than")}
"""For a limit that may be reached, and for one that may not."""

Check = Mapping[str, Any]


def only_follows(check: Check, checks: Sequence[Check]) -> bool:
    """Whether a check of a test is not met only as another one ended the drive."""
    may_follow = not check["ok"] and check["name"] in _OF_THE_WAY
    return may_follow and any(not other["ok"] and other["name"] in _ENDING for other in checks)


def is_exclusive(check: Check) -> bool:
    """Whether a value at a limit fails, as a wall that is touched: the evaluator says so, or failed such a value."""
    limit = check.get("limit") or {}
    return bool(check.get("exclusive")) or (not check["ok"] and check["value"] in limit.values())


def bound(side: str, number: float, unit: str = "", exclusive: bool = False) -> str:
    """``at least 1 m`` or ``more than 1 m`` for the side ``min``, ``at most 1 m`` or ``less than 1 m`` for ``max``."""
    return f"{_WORDS[side][exclusive]} {number:g} {unit}".rstrip()


def limits(check: Check) -> Iterator[str]:
    """Each limit of a check: ``at least 0.03 m`` and ``at most 1 m``."""
    exclusive = is_exclusive(check)
    for side in ("min", "max"):
        if side in (check.get("limit") or {}):
            yield bound(side, check["limit"][side], check.get("unit") or "", exclusive)


def check_line(check: Check, checks: Sequence[Check]) -> str:
    """A check of a test in a line."""
    value = "none" if check["value"] is None else f"{check['value']:g} {check.get('unit') or ''}".strip()
    if only_follows(check, checks):
        return f"--   {check['name']}: {value}, when the drive ended"
    limit = ", ".join(limits(check))
    return f"{'ok  ' if check['ok'] else 'FAIL'} {check['name']}: {value}{f' ({limit})' if limit else ''}"


NEGLIGIBLE = 0.01
"""Share of a limit by which a value may change without a word, where only its last decimal shows that."""

Direction = Literal["worse", "better", "different", "unchanged"]
"""``different`` is a change of a value that has no limit, or whose limits say nothing of the direction."""
DIRECTIONS: tuple[Direction, ...] = ("worse", "better", "different")
"""Of changes that are shown."""


@dataclass(frozen=True)
class CheckChange:
    """A check of a test in both reports; values in its unit, None if nothing was measured."""

    index: int
    """Of the check in the newer report's test."""
    name: str
    unit: str
    before: float | None
    after: float | None
    direction: Direction
    limits: tuple[str, ...]
    """In words, as they are now."""
    old_limits: tuple[str, ...]
    old_unit: str
    is_crossing: bool
    """Whether it is on the other side of its limit now."""

    @property
    def difference(self) -> float | None:
        """Of the values, if they have one unit."""
        is_comparable = self.before is not None and self.after is not None and self.unit == self.old_unit
        return self.after - self.before if is_comparable else None  # type: ignore[operator]


def check_change(before: Mapping[str, Any], after: Mapping[str, Any], index: int) -> CheckChange:
    """The change of a check between two ``results.json``."""
    return CheckChange(
        index,
        after["name"],
        after.get("unit") or "",
        before["value"],
        after["value"],
        _direction(before, after),
        tuple(limits(after)),
        tuple(limits(before)),
        before.get("unit") or "",
        bool(before["ok"]) != bool(after["ok"]),
    )


def with_margins(check: Mapping[str, Any]) -> Mapping[str, Any]:
    """The check with ``margin`` and ``margin_share``, computed where an older ``results.json`` has none."""
    return check if "margin" in check and "margin_share" in check else with_margin({"limit": {}, **check})


def _direction(before: Mapping[str, Any], after: Mapping[str, Any]) -> Direction:
    if bool(before["ok"]) != bool(after["ok"]):
        return "better" if after["ok"] else "worse"
    if differs_each_run(after["name"]):
        return "unchanged"  # it differs from run to run
    is_same_unit = (before.get("unit") or "") == (after.get("unit") or "")
    is_same_limit = (before.get("limit") or {}) == (after.get("limit") or {})
    if is_same_unit and is_same_limit and _is_alike(before["value"], after["value"], after.get("limit") or {}):
        return "unchanged"
    old, new = with_margins(before)["margin"], with_margins(after)["margin"]
    if not is_same_unit or old is None or new is None or _shown(old) == _shown(new):
        return "different"
    return "better" if new > old else "worse"


def _is_alike(before: float | None, after: float | None, limit: Mapping[str, float]) -> bool:
    """Whether values look the same, or differ in the last decimal only and by no more than 1 % of the limit.

    Where there is no limit but 0, by 1 % of the values. Counts differ from 1 on.
    """
    texts = _shown(before), _shown(after)
    if before is None or after is None or texts[0] == texts[1]:
        return texts[0] == texts[1]
    decimals = max(-int(Decimal(text).as_tuple().exponent) for text in texts)
    size = max((abs(bound) for bound in limit.values()), default=0.0) or max(abs(before), abs(after))
    change = abs(after - before)
    return decimals > 0 and change < 10 ** (1 - decimals) and change <= NEGLIGIBLE * size


def _shown(value: float | None) -> str:
    """As pages and texts show it: what no one sees is not a change."""
    return "none" if value is None else f"{value:.4g}"


@dataclass(frozen=True)
class JoinedTest:
    """A test with a slug and name that no other has, and where it comes from."""

    outcome: Outcome
    report: GivenReport
    slug: str
    """In the report that it comes from."""

    @property
    def is_renamed(self) -> bool:
        return self.outcome.slug != self.slug


def distinct(reports: Sequence[GivenReport]) -> Iterator[JoinedTest]:
    """All tests in the order of the reports.

    The first of a slug keeps it and its name; further ones are called ``<slug>--report-2`` and ``<name>[report=2]``,
    with the next number that is free.
    """
    given = [(outcome, report) for report in reports for outcome in report.outcomes]
    taken = {outcome.slug for outcome, _ in given}
    used: set[str] = set()
    numbers: dict[str, int] = {}
    for outcome, report in given:
        named = _renamed(outcome, taken, numbers) if outcome.slug in used else outcome
        used.add(outcome.slug)
        taken.add(named.slug)
        yield JoinedTest(named, report, outcome.slug)


def _renamed(outcome: Outcome, taken: Collection[str], numbers: dict[str, int]) -> Outcome:
    number = numbers.get(outcome.slug, 2)
    while f"{outcome.slug}--report-{number}" in taken:
        number += 1
    numbers[outcome.slug] = number + 1
    return replace(outcome, slug=f"{outcome.slug}--report-{number}", name=f"{outcome.name}[report={number}]")


Kind = Literal["newly failing", "still failing", "new", "gone", "fixed", "still passing"]
KINDS: tuple[Kind, ...] = ("newly failing", "still failing", "new", "gone", "fixed", "still passing")
"""The most urgent first."""


@dataclass(frozen=True)
class TestChange:
    """A test in two reports; None in the one without it."""

    __test__ = False  # no test of pytest

    kind: Kind
    before: Outcome | None
    after: Outcome | None
    checks: Sequence[CheckChange] = ()
    """Of those in both."""
    new_checks: Sequence[str] = ()
    gone_checks: Sequence[str] = ()

    def by_index(self) -> dict[int, CheckChange]:
        return {check.index: check for check in self.checks}

    @property
    def latest(self) -> Outcome:
        found = self.after or self.before
        assert found is not None
        return found


@dataclass(frozen=True)
class Comparison:
    """All tests of two reports, in the order of the newer one, those that are gone last."""

    other: str
    """The file of the older report."""
    tests: Sequence[TestChange]

    def of(self, kind: Kind) -> list[TestChange]:
        return [test for test in self.tests if test.kind == kind]

    def by_slug(self) -> dict[str, TestChange]:
        """The tests of the newer report."""
        return {test.after.slug: test for test in self.tests if test.after}

    def checks(self, direction: Direction) -> list[tuple[TestChange, CheckChange]]:
        """Those that crossed their limits first."""
        found = [(test, check) for test in self.tests for check in test.checks if check.direction == direction]
        return sorted(found, key=lambda pair: not pair[1].is_crossing)

    def in_words(self) -> str:
        """How many tests there are of each kind, as ``2 newly failing, 14 still passing``."""
        counts = Counter(test.kind for test in self.tests)
        return ", ".join(f"{counts[kind]} {kind}" for kind in KINDS if counts[kind]) or "no tests"


def compare(outcomes: Sequence[Outcome], other: GivenReport) -> Comparison:
    """Tests are the same where their slugs are."""
    old = {test.outcome.slug: test.outcome for test in distinct([other])}
    new = {outcome.slug: outcome for outcome in outcomes}
    tests = [_change(old.get(slug), outcome) for slug, outcome in new.items()]
    return Comparison(
        str(other.file), [*tests, *(_change(outcome, None) for s, outcome in old.items() if s not in new)]
    )


def _change(before: Outcome | None, after: Outcome | None) -> TestChange:
    if before is None or after is None:
        return TestChange("new" if before is None else "gone", before, after)
    was, now = numbered(before.checks), numbered(after.checks)
    return TestChange(
        _kind(before.outcome == "passed", after.outcome == "passed"),
        before,
        after,
        [check_change(was[key], check, index) for index, (key, check) in enumerate(now.items()) if key in was],
        [name for name, number in now if (name, number) not in was],
        [name for name, number in was if (name, number) not in now],
    )


def _kind(was_passed: bool, is_passed: bool) -> Kind:
    if was_passed:
        return "still passing" if is_passed else "newly failing"
    return "fixed" if is_passed else "still failing"


def value_text(number: float | None, unit: str) -> str:
    """``0.052 m``, or ``none``"""
    return "none" if number is None else f"{number:.4g} {unit}".rstrip()


def difference(check: CheckChange) -> str:
    """``-0.07 m``; empty if there is none."""
    return "" if not check.difference else f"{check.difference:+.3g} {check.unit}".rstrip()


def change_words(check: CheckChange) -> str:
    """``0.12 m -> 0.05 m (-0.07 m; limit: at least 0.03 m)``"""
    limit, old = ", ".join(check.limits), ", ".join(check.old_limits)
    was = f", was {old or 'none'}" if limit != old else ""
    notes = [difference(check), f"limit: {limit or 'none'}{was}" if limit or was else ""]
    told = "; ".join(filter(None, notes))
    before, after = value_text(check.before, check.old_unit), value_text(check.after, check.unit)
    return f"{before} -> {after}{f' ({told})' if told else ''}"


def outcomes(test: TestChange) -> str:
    """``passed -> failed``, or the only one there is."""
    found = [outcome.outcome for outcome in (test.before, test.after) if outcome is not None]
    return " -> ".join(dict.fromkeys(found))


FILE_NAME = "changes.md"
MOST_LINES = 60
_MARK = "<!-- written by dodo report -->"
"""The first line, by which the file is known as one of DoDo."""
_MOST_TEXT = 300
_SECTION = 3
"""Lines of a section without its items: a blank one, the title, and how many more there are."""


def to_markdown(comparison: Comparison, matrices: Sequence[str] = ()) -> str:
    """At most ``MOST_LINES`` lines; each section shows some of what it has, the first ones more.

    ``matrices`` says how the instances of each did.
    """
    sections = [(kind.capitalize(), [_test(test) for test in comparison.of(kind)]) for kind in KINDS[:-1]]
    sections.append(("Matrices", [code(line) for line in matrices]))
    for direction in DIRECTIONS:
        items = [_check(test, change_words(check), check.name) for test, check in comparison.checks(direction)]
        sections.append((f"Checks: {direction}", items))
    sections = [(title, items) for title, items in sections if items]
    head = [_MARK, f"**DoDo:** {comparison.in_words()}, compared with {code(comparison.other)}"]
    shares = _shares([len(items) for _, items in sections], MOST_LINES - len(head) - _SECTION * len(sections))
    body = [line for (title, items), most in zip(sections, shares, strict=True) for line in _lines(title, items, most)]
    return "\n".join([*head, *body]) + "\n"


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


def _shares(sizes: Sequence[int], most: int) -> list[int]:
    """How many items each section shows: one after the other gets one more, as long as there are any."""
    shares = [0] * len(sizes)
    while most > 0 and shares != [*sizes]:
        for number, size in enumerate(sizes):
            if most > 0 and shares[number] < size:
                shares[number] += 1
                most -= 1
    return shares


def _lines(title: str, items: Sequence[str], most: int) -> Iterator[str]:
    yield ""
    yield f"**{title} ({len(items)})**"
    yield from (f"- {item}" for item in items[:most])
    if len(items) > most:
        yield f"- and {len(items) - most} more"


def _test(test: TestChange) -> str:
    return f"{code(test.latest.name)}: {outcomes(test)}, {code(test.latest.reason)}"


def _check(test: TestChange, change: str, name: str) -> str:
    return f"{code(test.latest.name)} {code(name)}: {code(change)}"


def change_lines(comparison: Comparison) -> Iterator[str]:
    """A line a test that does not pass as before, one a check whose value changed, and counts of the rest."""
    yield f"compared with {printable(comparison.other)}: {comparison.in_words()}"
    for kind in KINDS[:-1]:
        for test in comparison.of(kind):
            outcome = test.latest
            reason = printable(outcome.reason)
            yield f"  {kind.upper():13}  {printable(outcome.name)}  {outcomes(test)}  {reason}"
    for test in comparison.tests:
        for what, names in (("new check", test.new_checks), ("gone check", test.gone_checks)):
            yield from (f"  {what:13}  {printable(test.latest.name)}  {printable(name)}" for name in names)
    for direction in DIRECTIONS:
        for test, check in comparison.checks(direction):
            told = printable(f"{check.name}  {change_words(check)}")
            yield f"  {direction:13}  {printable(test.latest.name)}  {told}"
    unchanged = len(comparison.checks("unchanged"))
    yield f"  {unchanged} {'check' if unchanged == 1 else 'checks'} unchanged"
