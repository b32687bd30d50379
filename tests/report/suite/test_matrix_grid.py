"""Instances of a matrix lie where their parameters say."""

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli import run_report
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.outcome import Outcome, with_margin
from dodo_dsl.report.comparison import compare
from dodo_dsl.report.instances import decisive_value, grids, worst_instances
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import GivenReport
from tests.report.changes.test_check_change import check
from tests.report.joined.reports import named


def shown(*names: str) -> list[tuple[object, ...]]:
    """Each grid's name, dimensions, columns, and rows of values and names."""
    found = grids([named(name) for name in names])
    return [
        (
            g.name,
            g.dimensions,
            g.column,
            g.columns,
            [(*r.values, *([o.name for o in c] for c in r.cells)) for r in g.rows],
        )
        for g in found
    ]


def test_two_parameters_are_rows_and_columns() -> None:
    names = [f"a[light={light},clutter={clutter}]" for light in (0.3, 1) for clutter in ("none", "much")]
    rows = [("0.3", [names[0]], [names[1]]), ("1", [names[2]], [names[3]])]
    assert shown("b", *names, "c") == [("a", ["light"], "clutter", ["none", "much"], rows)]


def test_one_parameter_is_a_column_of_rows() -> None:
    rows = [("dark", ["a[light=dark]"]), ("day", ["a[light=day]"])]
    assert shown("a[light=dark]", "a[light=day]") == [("a", ["light"], "", ["outcome"], rows)]


def test_repetitions_are_a_parameter_whose_first_value_is_not_written() -> None:
    rows = [("1", ["a[x=1]"], ["a[x=1][run=2]"]), ("2", ["a[x=2]"], [])]
    assert shown("a[x=1]", "a[x=2]", "a[x=1][run=2]") == [("a", ["x"], "run", ["1", "2"], rows)]
    assert shown("a", "a[report=2]") == [("a", ["report"], "", ["outcome"], [("1", ["a"]), ("2", ["a[report=2]"])])]


def test_values_with_commas_and_instances_of_one_name() -> None:
    rows = [("p,q", ["a[x=p,q,y=1]", "a[x=p,q,y=1]"])]
    assert shown("a[x=p,q,y=1]", "a[x=p,q,y=1]") == [("a", ["x"], "y", ["1"], rows)]


def test_names_of_strangers_make_no_huge_grid() -> None:
    assert shown(*(f"a[x={i},y={i}]" for i in range(1000))) == []
    assert shown(*(f"{'[a=b]' * 100_000}[x={i}]" for i in range(2))) == []


@pytest.mark.parametrize(
    "names", [["a"], ["a", "b"], ["a[x=1]"], ["a[x=1]", "a[y=1]"], ["a[x=1]", "a"], ["a[]", "a[[x]"]]
)
def test_what_is_no_matrix_has_no_grid(names: list[str]) -> None:
    assert shown(*names) == []


@pytest.mark.parametrize(
    ("checks", "told"),
    [
        ([], ""),
        ([check(1)], ""),
        ([check(9, max=10), check(0.1, min=0.01), check(5, max=6, unit="s")], "x 9 m"),
        ([check(9, max=10), check(2, max=1, unit="s"), check(3, max=1)], "x 2 s"),
        ([check(None, ok=False, max=1)], "x none"),
        (
            [
                {**check(None, ok=False, unit="s", max=40), "name": "time-to-goal"},
                {**check(0.0, ok=False, min=0), "name": "wall-margin"},
            ],
            "wall-margin 0 m",
        ),
    ],
)
def test_the_value_that_decided(checks: list[dict[str, Any]], told: str) -> None:
    assert decisive_value(named("a", checks=tuple(checks))) == told


def of_matrix() -> list[Outcome]:
    """Three recordings, of which the second failed, and others."""
    made = [
        named(f"a[rec={rec}]", outcome=outcome, checks=tuple(with_margin(check(value, min=0.5)) for value in values))
        for rec, outcome, values in (
            ("../r/x.rec", "passed", (0.6, 0.9)), ("../r/y.rec", "failed", (0.4, 0.9)), ("../r/z.rec", "error", ()),
        )
    ]  # fmt: skip
    return [*made, named("b"), named("b[run=2]"), named("c[x=1]")]


def test_the_worst_instance_of_a_matrix_is_named_by_its_margin() -> None:
    worst = "a: 1 of 3 passed, worst is [rec=../r/y.rec]: x 0.4 m (at least 0.5 m)"
    assert [one.in_words() for one in worst_instances(of_matrix())] == [worst]
    passed = [outcome for outcome in of_matrix() if outcome.outcome == "passed"]
    assert worst_instances(passed) == []
    best = replace(passed[0], name="a[rec=../r/w.rec]", checks=(with_margin(check(0.9, min=0.5)),))
    assert [one.choice for one in worst_instances([best, passed[0]])] == ["[rec=../r/x.rec]"]


def test_reports_name_the_worst_instance(tmp_path: Path) -> None:
    """On the page, in the note of a merge request, and at the end of a run, but not of a quiet one."""
    write_summaries(tmp_path, of_matrix(), compare(of_matrix(), GivenReport(Path("main"), [])))
    page = (tmp_path / "index.html").read_text()
    slug = of_matrix()[1].slug
    assert f'<p>1 of 3 passed; the worst is <a href="#{slug}">' in page and "x 0.4 m</p>" in page
    worst = "a: 1 of 3 passed, worst is [rec=../r/y.rec]: x 0.4 m (at least 0.5 m)"
    assert f"**Matrices (1)**\n- `{worst}`\n" in (tmp_path / "changes.md").read_text()
    for verbosity, number in ((Verbosity.NORMAL, 1), (Verbosity.QUIET, 0)):
        run_report.write_summary(stream := io.StringIO(), of_matrix(), {}, [], verbosity)
        assert stream.getvalue().splitlines().count(worst) == number
