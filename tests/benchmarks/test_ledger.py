from pathlib import Path

import pytest

from benchmarks.ledger.ledger import Bench, Ledger, read
from benchmarks.ledger.row import Goal, Row
from tests.benchmarks.rows import MACHINE, ledger, rated


def test_a_ledger_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = ledger(rated(1.5, 2, 2.5, goal=Goal(2, quartile=1.5)), Row("b", "", note="no peer"), trouble="slow")
    written.write(tmp_path / "new" / "ledger.json")
    assert read(tmp_path / "new" / "ledger.json") == written


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"dodo": "results", "version": 1}', '{"dodo": "ledger", "version": 1}']
)
def test_other_files_are_refused_by_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "other.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"other\.json: not a ledger of version 1"):
        read(file)


def test_several_runs_of_a_benchmark_make_one_row() -> None:
    runs = tuple(Bench("bench_bus", (rated(*ratios),), 1, 2, (0, 0)) for ratios in ((1, 2), (3, 4)))
    assert Ledger("abc", "now", MACHINE, runs).rows() == {"bus": rated(1, 2, 3, 4)}
