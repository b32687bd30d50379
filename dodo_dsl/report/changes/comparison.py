"""Two reports compared: which tests changed sides, came or went, and how the checks of those in both changed."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.changes.check_change import CheckChange, Direction, check_change
from dodo_dsl.report.distinct import distinct
from dodo_dsl.report.given_report import GivenReport

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
    was, now = _numbered(before.checks), _numbered(after.checks)
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


def _numbered(checks: Sequence[Mapping[str, Any]]) -> dict[tuple[str, int], Mapping[str, Any]]:
    """By name, and how many of that name came before it, as several evaluators may have one."""
    return dict(_keys(checks))


def _keys(checks: Sequence[Mapping[str, Any]]) -> Iterator[tuple[tuple[str, int], Mapping[str, Any]]]:
    counts: Counter[str] = Counter()
    for check in checks:
        yield (check["name"], counts[check["name"]]), check
        counts[check["name"]] += 1
