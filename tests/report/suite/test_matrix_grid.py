"""Instances of a matrix lie where their parameters say."""

import io
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.cli import run_report
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.outcome import Outcome, with_margin
from dodo_dsl.report.comparison import compare
from dodo_dsl.report.instances import compared, grids
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import GivenReport
from tests.report.joined.reports import check, named


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


def matrix(**values: tuple[str, float, float]) -> list[Outcome]:
    """Instances of a test by their outcome, ``to-goal`` and ``wall-margin``."""
    return [
        named(
            f"a[rec={rec}]",
            outcome=outcome,
            checks=(
                with_margin(check(left, name="to-goal", max=0)),
                with_margin(check(margin, name="wall-margin", min=0.02)),
            ),
        )
        for rec, (outcome, left, margin) in values.items()
    ]


def test_the_worst_instance_is_named_by_the_check_that_all_cells_show() -> None:
    """Not by the way left to the goal, which only follows from a wall that is touched."""
    outcomes = [
        *matrix(x=("passed", 0, 0.03), y=("failed", 3.4, 0), z=("passed", 0, 0.5)),
        named("a[rec=w]", outcome="error"),
    ]
    (found,) = compared([*outcomes, named("b"), named("b[run=2]"), named("c[x=1]")])
    assert found.in_words() == "a: 2 of 4 passed, worst is [rec=y]: wall-margin 0 m (at least 0.02 m)"
    assert [(one := found.of(o)) and one["value"] for o in outcomes] == [0.03, 0, 0.5, None]
    headlined = [replace(o, headline="to-goal") for o in matrix(x=("passed", 0, 0.03), y=("failed", 3.4, 0.4))]
    assert compared(headlined)[0].check == "to-goal"
    assert compared(matrix(x=("passed", 0, 0.03))) == []


def test_reports_name_the_worst_instance(tmp_path: Path) -> None:
    """On the page, in the note of a merge request, and at the end of a run, but not of a quiet one."""
    outcomes = matrix(x=("passed", 0, 0.03), y=("failed", 3.4, 0.01))
    write_summaries(tmp_path, outcomes, comparison=compare(outcomes, GivenReport(Path("main"), [])))
    page = (tmp_path / "index.html").read_text()
    assert (
        '<p>1 of 2 passed. Each cell shows wall-margin, at least 0.02\u00a0m; the worst is <a href="#a--rec-y">' in page
    )
    assert page.count('<a class="ok" href="#a--rec-x">') == page.count('<a class="no" href="#a--rec-y">') == 1
    worst = "a: 1 of 2 passed, worst is [rec=y]: wall-margin 0.01 m (at least 0.02 m)"
    assert f"**Matrices (1)**\n- `{worst}`\n" in (tmp_path / "changes.md").read_text()
    for verbosity, number in ((Verbosity.NORMAL, 1), (Verbosity.QUIET, 0)):
        run_report.write_summary(stream := io.StringIO(), outcomes, {}, [], verbosity)
        assert stream.getvalue().splitlines().count(worst) == number
