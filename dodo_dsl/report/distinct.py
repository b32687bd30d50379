"""One slug a test where several reports hold the same: retries, repetitions, or jobs that ran the same test."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.given_report import GivenReport


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
