"""What changed, as lines for a terminal."""

from collections.abc import Iterator

from dodo_dsl.report.changes import words
from dodo_dsl.report.changes.check_change import Direction
from dodo_dsl.report.changes.comparison import KINDS, Comparison
from dodo_dsl.terminal import printable

_SHOWN: tuple[Direction, ...] = ("worse", "better", "different")


def lines(comparison: Comparison) -> Iterator[str]:
    """A line a test that does not pass as before, one a check whose value changed, and counts of the rest."""
    yield f"compared with {printable(comparison.other)}: {comparison.in_words()}"
    for kind in KINDS:
        for test in comparison.of(kind) if kind != "still passing" else ():
            outcome = test.latest
            reason = printable(outcome.reason)
            yield f"  {kind.upper():13}  {printable(outcome.name)}  {words.outcomes(test)}  {reason}"
    for test in comparison.tests:
        for what, names in (("new check", test.new_checks), ("gone check", test.gone_checks)):
            yield from (f"  {what:13}  {printable(test.latest.name)}  {printable(name)}" for name in names)
    for direction in _SHOWN:
        for test, check in comparison.checks(direction):
            told = printable(f"{check.name}  {words.change(check)}")
            yield f"  {direction:13}  {printable(test.latest.name)}  {told}"
    unchanged = len(comparison.checks("unchanged"))
    yield f"  {unchanged} {'check' if unchanged == 1 else 'checks'} unchanged"
