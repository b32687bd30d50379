import pytest

from benchmarks.ledger.compare import BETTER, SAME, TOO_FEW, UNPAIRED, WORSE, compare
from benchmarks.ledger.row import Row, cost_row, rate_row
from benchmarks.ledger.spread import Spread
from tests.benchmarks.rows import ledger, rated


def verdict(before: Row, after: Row, in_turns: bool = False) -> str:
    (change,) = compare(ledger(before), ledger(after), in_turns)
    return change.verdict


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ((2.0, 2.1, 2.2), (1.0, 1.1, 1.2), WORSE),
        ((1.0, 1.1, 1.2), (2.0, 2.1, 2.2), BETTER),
        ((1.0, 2.0, 3.0), (0.9, 1.6, 2.4), SAME),
        ((2.0, 2.1), (1.0, 1.1), TOO_FEW),
    ],
)
def test_only_ratios_whose_quartiles_lie_apart_differ(before: list[float], after: list[float], expected: str) -> None:
    assert verdict(rated(*before), rated(*after)) == expected


def test_values_without_a_peer_are_judged_only_in_turns() -> None:
    before, after = cost_row("a", "s", [1.0, 1.1, 1.2]), cost_row("a", "s", [2.0, 2.1, 2.2])
    assert verdict(before, after) == UNPAIRED
    assert verdict(before, after, in_turns=True) == WORSE
    assert verdict(after, before, in_turns=True) == BETTER
    assert verdict(rate_row("a", "1/s", [1, 1.1, 1.2]), rate_row("a", "1/s", [2, 2.1, 2.2]), in_turns=True) == BETTER


def test_ratios_are_compared_where_both_have_them() -> None:
    alone = rate_row("bus", "messages/s", [5.0, 5.1, 5.2])
    assert verdict(rated(2, 2.1, 2.2), alone, in_turns=True) == WORSE  # 20 a second became 5
    (change,) = compare(ledger(rated(2, 3, 4)), ledger(rated(3, 4, 5)), in_turns=True)
    assert (change.before, change.after) == (Spread(2.5, 3, 3.5, 3), Spread(3.5, 4, 4.5, 3))


def test_rows_that_one_ledger_lacks_are_left_out() -> None:
    before = ledger(rated(1, 2, 3, what="a"), rated(1, 2, 3, what="b"), Row("c", "", note="no peer"))
    after = ledger(rated(1, 2, 3, what="b"), rated(1, 2, 3, what="c"), rated(1, 2, 3, what="d"))
    assert [change.what for change in compare(before, after, in_turns=True)] == ["b"]
