"""The page on a service of one's own is what happens, down to the image that it describes."""

import sys
from pathlib import Path

import pytest

from dodo_dsl.report import results
from dodo_dsl.report.join import read_document
from tests.contributing.tutorial import follow
from tests.report.viewer.drives import unpacked

PAGE = Path(__file__).parents[2] / "docs/how-to/services.md"


@pytest.mark.slow
def test_it_can_be_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    (tmp_path / "repository").mkdir()
    follow(PAGE, tmp_path / "repository", Path(sys.executable).parent)
    (outcome,) = results.load(tmp_path / "repository" / "dodo-report")
    data = read_document(tmp_path / "repository" / "dodo-report" / "sil-smooth" / "drive.js", outcome)
    steps_over_time = next(each for each in data["judged"] if each["evaluator"] == "smooth")
    assert (steps_over_time["name"], steps_over_time["note"]) == ("Step of the steering", "at most 3 deg")
    assert unpacked(steps_over_time["values"]).max() > 3 and steps_over_time["marks"]
    (check,) = [each for each in data["checks"] if each["name"] == "largest-step"]
    assert "max-step: 3 deg" in check["places"][0]["text"]
