from collections.abc import Iterator

import pytest

from benchmarks.ledger.budget import VARIABLE, Budget


class Clock:
    """Time that passes only when a round takes it."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def rounds(seconds: float | None, times: list[float], until: float = 1.0) -> int:
    """How many rounds there are, when they take these times."""
    clock = Clock()
    numbers: Iterator[int] = Budget(seconds, clock).rounds(len(times), until)
    count = 0
    for number in numbers:
        assert number == count
        clock.now += times[number]
        count += 1
    return count


@pytest.mark.parametrize(
    ("seconds", "times", "expected"),
    [
        (None, [9.0] * 5, 5),
        (50, [9.0] * 5, 5),
        (44, [9.0] * 5, 4),
        (5, [9.0] * 5, 1),
        (30, [1.0, 20.0, 1.0, 1.0], 2),  # the longest may come again
    ],
)
def test_a_round_begins_only_when_it_fits(seconds: float | None, times: list[float], expected: int) -> None:
    assert rounds(seconds, times) == expected


def test_a_part_of_the_budget_may_be_exceeded_for_three_rounds() -> None:
    assert rounds(50, [9.0] * 9, until=0.2) == 3
    assert rounds(50, [9.0] * 9, until=0.8) == 4
    assert rounds(20, [9.0] * 9, until=0.2) == 2


def test_the_budget_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "12.5")
    assert 0 < Budget.given().left() <= 12.5 and Budget.given().limited
    monkeypatch.delenv(VARIABLE)
    assert Budget.given().left() == float("inf") and not Budget.given().limited
