"""Values of checks in earlier runs: kept beside a report, and drawn."""

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from dodo_dsl.report import overview
from dodo_dsl.report.report_folder import write_summaries
from tests.report.joined.reports import named

CHECK: dict[str, Any] = {"name": "wall-margin", "value": 0.2, "limit": {"min": 0.1}, "unit": "m", "ok": True}


def runs(*values: float) -> list[dict[str, Any]]:
    return [{"when": 1, "outcome": "passed", "checks": {"wall-margin": value}} for value in values]


def test_a_curve_has_a_point_a_run_and_a_line_a_limit() -> None:
    svg = ElementTree.fromstring(overview.curve({"a": runs(0.1, 0.3, 0.2)}, "a", CHECK))
    assert svg.findtext("title") == "last 3 values: 0.1 to 0.3"
    points = svg.find("polyline").get("points")  # type: ignore[union-attr]
    assert points == "3,17 32,3 61,10"
    assert [line.get("y1") for line in svg.findall("line")] == ["17"]


def test_a_limit_far_away_flattens_no_curve() -> None:
    assert "<line" not in overview.curve({"a": runs(0.1, 0.3)}, "a", {**CHECK, "limit": {"max": 40.0}})


def test_values_that_stay_the_same_have_no_curve() -> None:
    assert overview.curve({"a": runs(0.2, 0.2)}, "a", CHECK) == ""


@pytest.mark.parametrize(
    "past",
    [{}, {"a": runs(0.1)}, {"a": 3}, {"a": [{}, {}]}, {"a": [{"checks": {"wall-margin": "<b>"}}] * 2},
     {"a": runs(float("inf"), 1.0)}, {"a": [{"checks": None}] * 2}],
)  # fmt: skip
def test_what_is_no_history_has_no_curve(past: Any) -> None:
    assert overview.curve(past, "a", CHECK) == ""


def test_the_page_shows_curves_until_another_run_has_none(tmp_path: Path) -> None:
    outcomes = [named("a", checks=(CHECK,)), named("b", checks=(CHECK,))]
    write_summaries(tmp_path, outcomes, past={"a": runs(0.1, 0.2)})
    for _ in range(2):
        page = (tmp_path / "index.html").read_text()
        assert re.findall(r"<title>(last[^<]*)<", page) == ["last 2 values: 0.1 to 0.2"]
        write_summaries(tmp_path, outcomes)
    write_summaries(tmp_path, outcomes, past={})
    assert "Latest runs" not in (tmp_path / "index.html").read_text()


@pytest.mark.parametrize("text", ["", "[]", "{", '{"a": ' * 3000])
def test_a_damaged_file_is_no_history(tmp_path: Path, text: str) -> None:
    (tmp_path / overview.FILE_NAME).write_text(text)
    assert overview.read_history(tmp_path) == {}


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    overview.write_history(tmp_path, {"a": runs(0.1)})
    assert overview.read_history(tmp_path) == json.loads(json.dumps({"a": runs(0.1)}))
