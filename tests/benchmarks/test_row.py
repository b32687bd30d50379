import json
from pathlib import Path

import pytest

from benchmarks.ledger.row import (
    FILE_VARIABLE,
    NOT_REACHED,
    Goal,
    Row,
    cost_row,
    joined,
    plan,
    rate_row,
    read_rows,
    report,
)


def test_a_ratio_says_how_many_times_as_good_in_each_round() -> None:
    assert rate_row("a", "1/s", [6, 9], "peer", [3, 2]).ratios == (2, 4.5)
    assert cost_row("a", "s", [3, 2], "peer", [6, 9]).ratios == (2, 4.5)
    assert cost_row("a", "s", [3, 2]).ratios == ()


def test_rounds_without_a_value_of_the_peer_are_refused() -> None:
    with pytest.raises(ValueError, match="argument 2 is shorter"):
        rate_row("a", "1/s", [6, 9], "peer", [3])


def test_reported_rows_are_read_and_later_ones_replace_earlier(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "rows.jsonl"
    monkeypatch.setenv(FILE_VARIABLE, str(file))
    early, other = rate_row("a", "1/s", [6]), Row("b", "", note="no peer")
    late = rate_row("a", "1/s", [6, 9], "peer", [3, 2], goal=Goal(2, quartile=1.5), note="n")
    report(early, other)
    report(late)
    assert read_rows(file) == [late, other]


def test_a_line_that_was_cut_off_is_left_out(tmp_path: Path) -> None:
    row, file = rate_row("a", "1/s", [6.5]), tmp_path / "rows.jsonl"
    line = json.dumps(row.to_json())
    file.write_text(f'{line}\n[]\n{{"what": 1, "colour": 2}}\n{line[:-9]}')
    assert read_rows(file) == [row]
    assert read_rows(tmp_path / "absent") == []


def test_a_planned_row_stays_until_it_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "rows.jsonl"
    monkeypatch.setenv(FILE_VARIABLE, str(file))
    plan(rate_row("a", "1/s", [], goal=Goal(2)), cost_row("b", "s", []))
    report(cost_row("b", "s", [3]))
    assert read_rows(file) == [Row("a", "1/s", goal=Goal(2), note=NOT_REACHED), cost_row("b", "s", [3])]


def test_alone_nothing_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FILE_VARIABLE, raising=False)
    monkeypatch.chdir(tmp_path)
    report(rate_row("a", "1/s", [6]))
    assert not list(tmp_path.iterdir())


def test_rounds_of_several_runs_become_one_row() -> None:
    first, second = rate_row("a", "1/s", [6], "peer", [3]), rate_row("a", "1/s", [8, 9], "peer", [4, 3], note="n")
    assert joined([first, second]) == rate_row("a", "1/s", [6, 8, 9], "peer", [3, 4, 3], note="n")
