"""Instances of a matrix, and repetitions, beside each other."""

import io
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.cli import run_report
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.outcome import Outcome, with_margin
from dodo_dsl.report.instances import families, summary
from dodo_dsl.report.report_folder import write_summaries
from tests.report.joined.reports import check, named


def test_instances_and_repetitions_of_a_test_are_one_family() -> None:
    names = ["b", "a[x=1]", "c", "a[x=2]", "a[x=1][run=2]", "c[report=2]", f"{'[a=b]' * 10_000}[x=1]"]
    found = [(family.name, [o.name for o in family.outcomes]) for family in families([named(name) for name in names])]
    assert found == [
        ("b", ["b"]), ("a", ["a[x=1]", "a[x=2]", "a[x=1][run=2]"]), ("c", ["c", "c[report=2]"]), ("", names[-1:])
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (
            [f"a[light={light},clutter={clutter}]" for light in (0.3, 1) for clutter in ("none", "much")],
            (["light"], "clutter", ["none", "much"], {("0.3",): "01", ("1",): "23"}),
        ),
        (["a[x=p,q,y=1]", "a[x=p,q,y=1]"], (["x"], "y", ["1"], {("p,q",): "01"})),
        (["a[x=1]", "a[x=2]", "a[x=1][run=2]"], (["x"], "run", ["1", "2"], {("1",): "02", ("2",): "1"})),
        (["a", "a[report=2]"], (["report"], "", ["1"], {("1",): "0", ("2",): "1"})),
        (["a", "a"], None),
        ([f"a[x={n},y={n}]" for n in range(1000)], None),
    ],
)
def test_a_grid_has_the_last_parameter_as_columns_and_the_others_as_rows(names: list[str], expected: object) -> None:
    """The first of repetitions is not numbered; names of strangers make no huge grid."""
    (family,) = families([replace(named(name), slug=f"{n}") for n, name in enumerate(names)])
    grid = family.grid()
    cells = grid and {key: "".join(o.slug for cell in row.values() for o in cell) for key, row in grid.rows.items()}
    assert (grid and (grid.names, grid.column, grid.values, cells)) == expected


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


def test_the_worst_instance_is_named_by_the_check_that_all_have() -> None:
    """Not by the way left to the goal, which only follows from a wall that is touched."""
    outcomes = [
        *matrix(x=("passed", 0, 0.03), y=("failed", 3.4, 0), z=("passed", 0, 0.5)),
        named("a[rec=w]", outcome="error"),
    ]
    assert summary([*outcomes, named("b"), named("c"), named("c[run=2]")]) == [
        "a: 2 of 4 passed, worst is [rec=y]: wall-margin 0 m (at least 0.02 m)",
        "c: 2 of 2 passed",
    ]
    headlined = [replace(o, headline="to-goal") for o in matrix(x=("passed", 0, 0.03), y=("failed", 3.4, 0.4))]
    assert summary(headlined) == ["a: 1 of 2 passed, worst is [rec=y]: to-goal 3.4 m (at most 0 m)"]
    (text,) = summary(matrix(x=("failed", 1.0, 0), y=("failed", 3.4, 0), z=("passed", 0, 0.5)))
    assert "worst is [rec=y]: wall-margin 0 m" in text, "both hit the wall, and y farther from the goal"
    assert summary(matrix(x=("passed", 0, 0.03))) == []


def test_reports_name_the_worst_instance(tmp_path: Path) -> None:
    """On the page and at the end of a run, but not of a quiet one."""
    outcomes = matrix(x=("passed", 0, 0.03), y=("failed", 3.4, 0.01))
    write_summaries(tmp_path, outcomes)
    page = (tmp_path / "index.html").read_text()
    assert "<span>worst: wall-margin 0.01 m</span>" in page
    assert 'Each cell shows wall-margin, at least 0.02 m; the worst is <a href="#a--rec-y">' in page
    assert page.count('<a class="ok" href="#a--rec-x">') == page.count('<a class="no" href="#a--rec-y">') == 1
    worst = "a: 1 of 2 passed, worst is [rec=y]: wall-margin 0.01 m (at least 0.02 m)"
    for verbosity, number in ((Verbosity.NORMAL, 1), (Verbosity.QUIET, 0)):
        run_report.write_summary(stream := io.StringIO(), outcomes, [], verbosity)
        assert stream.getvalue().splitlines().count(worst) == number
