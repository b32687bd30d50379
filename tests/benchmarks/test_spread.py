import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.ledger.spread import Spread

VALUES = st.lists(st.floats(0.01, 1e6), min_size=3, max_size=20)


def test_quartiles() -> None:
    assert Spread.of([5, 1, 3, 2, 4]) == Spread(2, 3, 4, 5)
    assert Spread.of([7]) == Spread(7, 7, 7, 1)
    with pytest.raises(ValueError, match="no rounds"):
        Spread.of([])


@pytest.mark.parametrize(
    ("one", "other", "order"),
    [
        ([5, 6, 7], [1, 2, 3], 1),
        ([1, 2, 3], [5, 6, 7], -1),
        ([1, 2, 9], [2, 3, 4], 0),
        ([2, 2, 2], [2, 2, 2], 0),
        ([5, 6], [1, 2, 3], 0),  # too few rounds
    ],
)
def test_order(one: list[float], other: list[float], order: int) -> None:
    assert Spread.of(one).order(Spread.of(other)) == order


@given(VALUES, VALUES)
@settings(max_examples=30)
@pytest.mark.thorough
def test_the_order_turns_round(one: list[float], other: list[float]) -> None:
    a, b = Spread.of(one), Spread.of(other)
    assert a.low <= a.middle <= a.high
    assert a.order(b) == -b.order(a)
    assert a.order(a) == 0
