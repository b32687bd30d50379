"""Two reports compared, on the terminal and in Markdown."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import atomic
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import comparison
from dodo_dsl.report.comparison import Comparison, compare
from dodo_dsl.report.results import GivenReport
from tests.report.changes.test_check_change import check
from tests.report.joined.reports import named
from tests.report.viewer.hostile import HOSTILE


def compared(before: list[Outcome], after: list[Outcome]) -> Comparison:
    return compare(after, GivenReport(Path("main/results.json"), before))


def failed(name: str, *checks: dict[str, object]) -> Outcome:
    return named(name, outcome="failed", reason="hit wall", checks=checks)


BEFORE = [named("a"), failed("b"), failed("c"), named("d", checks=(check(1, max=2), check(3, max=4))), named("old")]
AFTER = [
    failed("a", check(1, max=2)),
    named("b"),
    named("c", outcome="error", reason="crashed"),
    named("d", checks=(check(1.5, max=2), check(3, max=4), {**check(5), "name": "y"})),
    named("new"),
]


def test_every_test_is_of_one_kind() -> None:
    found = compared(BEFORE, AFTER)
    assert [(test.kind, test.latest.name) for test in found.tests] == [
        ("newly failing", "a"),
        ("fixed", "b"),
        ("still failing", "c"),
        ("still passing", "d"),
        ("new", "new"),
        ("gone", "old"),
    ]


def test_checks_of_one_name_are_compared_in_their_order() -> None:
    (test,) = [test for test in compared(BEFORE, AFTER).tests if test.latest.name == "d"]
    assert [(c.index, c.before, c.after, c.direction) for c in test.checks] == [
        (0, 1, 1.5, "worse"),
        (1, 3, 3, "unchanged"),
    ]
    assert (test.new_checks, test.gone_checks) == (["y"], [])


def test_the_terminal_shows_what_changed() -> None:
    assert list(comparison.change_lines(compared(BEFORE, AFTER))) == [
        "compared with main/results.json: 1 newly failing, 1 still failing, 1 new, 1 gone, 1 fixed, 1 still passing",
        "  NEWLY FAILING  a  passed -> failed  hit wall",
        "  STILL FAILING  c  failed -> error  crashed",
        "  NEW            new  passed  drove",
        "  GONE           old  passed  drove",
        "  FIXED          b  failed -> passed  drove",
        "  new check      a  x",
        "  new check      d  y",
        "  worse          d  x  1 m -> 1.5 m (+0.5 m; limit: at most 2 m)",
        "  1 check unchanged",
    ]


def test_markdown_shows_what_changed() -> None:
    counts = "1 newly failing, 1 still failing, 1 new, 1 gone, 1 fixed, 1 still passing"
    assert comparison.to_markdown(compared(BEFORE, AFTER)).splitlines()[1:] == [
        f"**DoDo:** {counts}, compared with `main/results.json`",
        "",
        "**Newly failing (1)**",
        "- `a`: passed -> failed, `hit wall`",
        "",
        "**Still failing (1)**",
        "- `c`: failed -> error, `crashed`",
        "",
        "**New (1)**",
        "- `new`: passed, `drove`",
        "",
        "**Gone (1)**",
        "- `old`: passed, `drove`",
        "",
        "**Fixed (1)**",
        "- `b`: failed -> passed, `drove`",
        "",
        "**Checks: worse (1)**",
        "- `d` `x`: `1 m -> 1.5 m (+0.5 m; limit: at most 2 m)`",
    ]  # fmt: skip


@pytest.mark.parametrize("number", [1, 3, 7, 8, 40, 500])
def test_markdown_is_short(number: int) -> None:
    """With all sections, each with many items: the counts are of all."""
    one = (check(1, min=0), check(1, max=3), check(1))
    two = (check(2, min=0), check(2, max=3), check(2))
    before = [named(f"{kind}-{n}", checks=one) for kind in ("newly", "gone") for n in range(number)]
    before += [failed(f"{kind}-{n}", *one) for kind in ("still", "fixed") for n in range(number)]
    after = [failed(f"{kind}-{n}", *two) for kind in ("newly", "still") for n in range(number)]
    after += [named(f"{kind}-{n}", checks=two) for kind in ("new", "fixed") for n in range(number)]
    lines = comparison.to_markdown(compared(before, after)).splitlines()
    assert len(lines) <= comparison.MOST_LINES
    shown = [int(line.split("(")[1].removesuffix(")**")) for line in lines if line.startswith("**") and "(" in line]
    assert shown == [number] * 5 + [3 * number] * 3
    assert number < 7 or len(lines) > comparison.MOST_LINES - 8


@pytest.mark.parametrize("hostile", [*HOSTILE, "` @all /close `", "a\n/close\n", "| --- |", "![](http://example.org)"])
def test_markdown_has_no_markup_of_others(hostile: str) -> None:
    """All text of others is code: what is left without the code is DoDo's own, line by line."""
    outcome = named("a", outcome="failed", reason=hostile, checks=({**check(2, max=1), "name": hostile},))
    outcome = replace(outcome, name=hostile)
    old = named("a", checks=({**check(1, max=1), "name": hostile},))
    lines = comparison.to_markdown(compare([outcome], GivenReport(Path(hostile), [old]))).splitlines()
    assert [re.sub("`[^`]*`", "CODE", line) for line in lines] == [
        "<!-- written by dodo report -->",
        "**DoDo:** 1 newly failing, compared with CODE",
        "",
        "**Newly failing (1)**",
        "- CODE: passed -> failed, CODE",
        "",
        "**Checks: worse (1)**",
        "- CODE CODE: CODE",
    ]
    assert all(line.isprintable() and len(line) < 1000 for line in lines)


def test_a_file_of_others_is_not_replaced(tmp_path: Path) -> None:
    found, file = compared(BEFORE, AFTER), tmp_path / "changes.md"
    comparison.write_markdown(tmp_path, found)
    assert file.read_text() == comparison.to_markdown(found)
    comparison.write_markdown(tmp_path, None)
    assert not file.exists()
    file.write_text("# My changes\n")
    comparison.write_markdown(tmp_path, None)
    with pytest.raises(atomic.NotReplaceable, match="not written by DoDo"):
        comparison.write_markdown(tmp_path, found)
    assert file.read_text() == "# My changes\n"
