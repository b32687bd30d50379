import pytest

from benchmarks.ledger.compare import compare
from benchmarks.ledger.row import Goal, Row, cost_row
from benchmarks.ledger.table import change_table, goal_text, is_met, ledger_table, number
from tests.benchmarks.rows import ledger, rated

VALUE = Goal(0.2, of="value")


@pytest.mark.parametrize(
    ("row", "met"),
    [
        (rated(1, 2, 3), None),
        (rated(1, 2, 3, goal=Goal(2)), True),
        (rated(1, 1.9, 3, goal=Goal(2)), False),
        (rated(1.5, 2, 3, goal=Goal(2, quartile=1.8)), False),
        (rated(1.7, 2, 3, goal=Goal(2, quartile=1.8)), True),
        (cost_row("a", "s", [0.1, 0.2, 0.3], goal=VALUE), True),
        (cost_row("a", "s", [0.1, 0.21, 0.3], goal=VALUE), False),
        (cost_row("a", "s", [0.1], "peer", [9], goal=VALUE), True),
        (cost_row("a", "s", [0.1], goal=Goal(2)), None),
        (rated(1, 2, 3, goal=Goal(20, of="value")), True),
        (rated(1, 1.9, 3, goal=Goal(20, of="value")), False),
    ],
)
def test_a_goal_is_of_the_median(row: Row, met: bool | None) -> None:
    assert is_met(row) is met


def test_a_goal_in_words() -> None:
    assert goal_text(cost_row("a", "s", [], goal=VALUE)) == "at most 0.2 s"
    assert goal_text(rated(goal=Goal(20, of="value"))) == "at least 20 messages/s"
    assert goal_text(rated(goal=Goal(2, quartile=1.5))) == "at least 2, lower quartile above 1.5"


def test_numbers_have_the_digits_that_count() -> None:
    assert [number(v) for v in (0.01234, 1.996, 12.34, 123.4, 12345.6)] == ["0.0123", "2", "12.3", "123", "12,346"]


def test_the_table_has_every_row_and_says_what_was_not_measured() -> None:
    absent = Row("pull", "s", note="no engine answers", goal=Goal(1))
    text = ledger_table(ledger(rated(1.5, 2, 3, goal=Goal(2)), absent, trouble="did not end in 40 s, and was ended"))
    assert text.splitlines() == [
        "Commit abc, 2026-01-02 03:04 UTC, 12 s",
        "on a processor, 2 cores, 8 GB, Linux 6, Python 3.11.9; load 0.5 to 1.5",
        "",
        "| what | ours          | peer   | theirs        | ratio | quartiles   | rounds | goal       | met     | note |",  # noqa: E501
        "|------|---------------|--------|---------------|-------|-------------|--------|------------|---------|------|",
        "| bus  | 20 messages/s | a peer | 10 messages/s | 2     | 1.75 to 2.5 | 3      | at least 2 | yes     |      |",  # noqa: E501
        "| pull | not measured  |        |               |       |             |        | at least 1 | unknown | no engine answers |",  # noqa: E501
        "",
        "- did not end in 40 s, and was ended: bench_bus",
    ]


def test_trouble_that_a_row_tells_is_told_once() -> None:
    text = ledger_table(ledger(Row("bench_bus", "", note="ended with 3"), trouble="ended with 3"))
    assert text.count("ended with 3") == 1


def test_the_table_of_changes() -> None:
    changes = compare(ledger(rated(2, 2.1, 2.2)), ledger(rated(1, 1.1, 1.2)), in_turns=False)
    assert change_table(changes, "abc", "def").splitlines() == [
        "def against abc",
        "",
        "| what | before | quartiles    | after | quartiles    | result |",
        "|------|--------|--------------|-------|--------------|--------|",
        "| bus  | 2.1    | 2.05 to 2.15 | 1.1   | 1.05 to 1.15 | worse  |",
    ]
