"""The end of a run in words."""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli import run_report
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.cli.run_report import Reported
from dodo_dsl.outcome import NotRun, ServiceUse, with_margin
from dodo_dsl.plan.model import Flag, Place, PlannedService
from tests.cli.terminal import Terminal
from tests.report.joined.reports import named, write
from tests.report.test_report_folder import OUTCOME
from tests.run.scripted import plan

PASSED = replace(OUTCOME, name="ok", slug="ok", outcome="passed", reason="reached it", setup_s=1.0, execution_s=2.25)


def text(outcomes: list[object], skipped: tuple[NotRun, ...] = ()) -> str:
    stream = StringIO()
    run_report.write_summary(stream, outcomes, skipped)  # type: ignore[arg-type]
    return stream.getvalue()


def test_a_line_each_with_what_explains_it() -> None:
    failed = replace(OUTCOME, notes=("a note",), last_lines=("the last\x1b",))
    assert text([PASSED, failed]) == (
        "\n        test     time     real  closest to failing\n"
        "PASSED  ok    2.2 s    3.2 s  reached it\n"
        "FAILED  test  hit wall\n"
        "        note: a note\n"
        "        | the last�\n"
        "\n1 passed, 1 failed, 0 in error\n"
    )


def test_repetitions_have_a_rate_and_skipped_tests_are_named() -> None:
    again = replace(PASSED, name="ok[run=2]", slug="ok--run-2", outcome="failed")
    shown = text(
        [PASSED, again],
        tuple(NotRun(name, name, "", "sil", "the run was interrupted") for name in "abcdef"),
    )
    assert "\nok: 1 of 2 passed\n" in shown
    assert shown.endswith("6 tests not run, because the run was interrupted: a, b, c, d, e and 1 more\n")


def test_verbose_shows_checks_and_use(tmp_path: Path) -> None:
    passed = replace(PASSED, checks=({"name": "gap", "value": 0.5, "limit": {"min": 0.1}, "unit": "m", "ok": True},))
    passed = replace(passed, resources=(ServiceUse("steering", 1.5, 0.25, 150_000_000),))
    stream, reported = StringIO(), Reported(plan(), tmp_path, Path("dodo-report/ok"))
    run_report.write_summary(stream, [passed], [], Verbosity.VERBOSE, {"ok": reported})
    used = "1.50 s of processor time (25 % of a processor), up to 150 MB of memory"
    assert stream.getvalue().splitlines()[2:-2] == [
        "PASSED  ok    2.2 s    3.2 s  gap 0.5 m (at least 0.1 m)",
        "        reached it (set-up 1.0 s, ran 2.2 s)",
        "        ok   gap: 0.5 m (at least 0.1 m)",
        f"        steering: {used}",
    ]


GAP = with_margin({"name": "gap", "value": 0.0123, "limit": {"min": 0.0}, "unit": "m", "ok": True, "exclusive": True})
LONG = "with-a-name-that-leaves-no-room[light=dark]"


def test_rows_are_whole_and_have_the_decisive_check() -> None:
    near = replace(PASSED, name="near", checks=(GAP,), sim_s=12.0)
    lines = text([near, replace(near, name=LONG), PASSED]).splitlines()[1:5]
    name = "test".ljust(len(LONG))
    assert lines == [
        f"        {name}     time     real  closest to failing",
        f"PASSED  {'near':<{len(LONG)}}   12.0 s    3.2 s  gap 0.0123 m (more than 0 m)",
        f"PASSED  {LONG}   12.0 s    3.2 s  gap 0.0123 m (more than 0 m)",
        f"PASSED  {'ok':<{len(LONG)}}    2.2 s    3.2 s  reached it",
    ]


def test_a_failure_says_what_where_and_which_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.chdir(tmp_path)
    Path("dodo-report/test").mkdir(parents=True)
    Path("dodo-report/test/drive.html").touch()
    places = {"evaluation.track": Place("a/b.dodo.yml", 7, 3), "evaluation.track.min-gap": Place("a/b.dodo.yml", 8, 9)}
    judge = PlannedService("evaluation", "track", "x", "x", (), (Flag("min-gap", "1"),), judge=True)
    tested = replace(plan(), services=(judge,), source_map=places)
    gap = {**GAP, "value": -1.0, "ok": False}
    verdict = {"evaluator": "track", "outcome": "failed", "reason": "hit"}
    failed = replace(OUTCOME, checks=(gap, {**GAP, "name": "held"}), reason="hit wall left " * 5, verdicts=(verdict,))
    error = replace(OUTCOME, slug="e", outcome="error", reason="service 'track' ended with exit code 2")
    stream, reported = Terminal(), Reported(tested, Path("dodo-report/test"), Path("dodo-report/test"))
    about = {"test": reported, "e": replace(reported, folder=Path("dodo-report/e"))}
    run_report.write_summary(stream, [error, failed, replace(failed, checks=())], [], reported=about)
    assert stream.getvalue().splitlines()[1:8] == [
        "FAILED  test  hit wall left hit wall left hit wall left hit wall left hit wall left",
        "        FAIL gap: -1 m (more than 0 m)",
        "        in a/b.dodo.yml:8:9",
        "        open dodo-report/test/drive.html",
        "FAILED  test  hit wall left hit wall left hit wall left hit wall left hit wall left",
        "        in a/b.dodo.yml:7:3",
        "        open dodo-report/test/drive.html",
    ]
    assert stream.getvalue().splitlines()[8:11] == [
        "ERROR   test  service 'track' ended with exit code 2",
        "        in a/b.dodo.yml:7:3",
        "        open dodo-report/index.html",
    ]


def test_results_of_tests_that_are_no_more_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the registry and of its matrices; a spec elsewhere stays as long as its file."""
    monkeypatch.chdir(tmp_path)
    names = ("a[light=1]", "a[light=2]", "a[light=2][run=2]", "b", "mine", "gone")
    write(tmp_path / "report", [named(name, spec=f"{name}.dodo.yml") for name in names])
    (tmp_path / "mine.dodo.yml").touch()
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "a.dodo.yml").write_text("dodo: 1\nname: a\nmatrix: {light: [2, 3]}\n")
    (tmp_path / "tests" / "b.dodo.yml").write_text("dodo: 1\nname: b\n")
    kept = run_report.earlier(tmp_path / "report", ["b[run=7]"], [tmp_path / "tests"])
    assert kept and [outcome.name for outcome in kept.outcomes] == ["a[light=2]", "a[light=2][run=2]", "mine"]
    everything = run_report.earlier(tmp_path / "report", [], [])
    assert everything and len(everything.outcomes) == len(names)
