"""Instances of a matrix lie where their parameters say."""

from typing import Any

import pytest

from dodo_dsl.report.overview import decisive_value, grids
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
