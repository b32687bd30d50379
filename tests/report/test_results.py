"""``results.json`` is read only when it is one."""

import json
from pathlib import Path

import pytest

from dodo_dsl.report import results
from dodo_dsl.report.report_folder import forget
from tests.report.test_report_folder import OUTCOME


@pytest.mark.parametrize("text", ["", "[]", '{"dodo": "results", "version": 1, "tests": [3]}', "[" * 100_000])
def test_other_files_are_not_results(tmp_path: Path, text: str) -> None:
    (tmp_path / "results.json").write_text(text)
    with pytest.raises(results.ResultsError):
        results.load(tmp_path / "results.json")


STRANGE = [{"slug": 3}, {"slug": ["a"]}, {"outcome": "maybe"}, {"checks": 3}, {"reason": "\ud800"}, {"more": 1}]


@pytest.mark.parametrize("change", STRANGE, ids=str)
def test_results_of_a_strange_shape_are_refused_and_stop_no_run(tmp_path: Path, change: dict[str, object]) -> None:
    document = json.loads(results.to_json([OUTCOME]))
    document["tests"][0].update(change)
    (tmp_path / "results.json").write_text(json.dumps(document))
    with pytest.raises(results.ResultsError):
        results.load(tmp_path / "results.json")
    forget(tmp_path, ["test"])


def test_results_that_cannot_be_read_stop_no_run(tmp_path: Path) -> None:
    (tmp_path / "results.json").mkdir()
    with pytest.raises(results.ResultsError, match="cannot be read: Is a directory"):
        results.load(tmp_path / "results.json")
    forget(tmp_path, ["test"])
