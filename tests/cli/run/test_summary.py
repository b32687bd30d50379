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
from tests.report.test_report_folder import OUTCOME
from tests.run.scripted import plan

PASSED = replace(OUTCOME, name="ok", slug="ok", outcome="passed", reason="reached it", setup_s=1.0, execution_s=2.25)


def text(outcomes: list[object], tests: dict[str, str], skipped: tuple[NotRun, ...] = ()) -> str:
    stream = StringIO()
    run_report.write_summary(stream, outcomes, tests, skipped)  # type: ignore[arg-type]
    return stream.getvalue()


def test_a_line_each_with_what_explains_it() -> None:
    failed = replace(OUTCOME, notes=("a note",), last_lines=("the last\x1b",))
    assert text([PASSED, failed], {"ok": "ok", "test": "test"}) == (
        "\n        test     time     real  closest to failing\n"
        "PASSED  ok    2.2 s    3.2 s  reached it\n"
        "FAILED  test  hit wall\n"
        "        note: a note\n"
        "        | the last�\n"
        "\n1 passed, 1 failed, 0 in error\n"
    )


def test_repetitions_have_a_rate_and_skipped_tests_are_named() -> None:
    again = replace(PASSED, slug="ok--run-2", outcome="failed")
    shown = text(
        [PASSED, again],
        {"ok": "ok", "ok--run-2": "ok"},
        tuple(NotRun(name, name, "", "sil", "the run was interrupted") for name in "abcdef"),
    )
    assert "\nok: 1 of 2 passed (50.0%)\n" in shown
    assert shown.endswith("6 tests not run, because the run was interrupted: a, b, c, d, e and 1 more\n")


def test_verbose_shows_checks_use_and_what_services_complained_of(tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "application.steering.log").write_text("frame 0\nwarning: late\x07\nTraceback\n  File x\n")
    (logs / "evaluation.track.log").write_text("ready\n" + "error: no map\n" * 22)
    passed = replace(PASSED, checks=({"name": "gap", "value": 0.5, "limit": {"min": 0.1}, "unit": "m", "ok": True},))
    passed = replace(passed, resources=(ServiceUse("steering", 1.5, 0.25, 150_000_000),))
    stream, reported = StringIO(), Reported(plan(), tmp_path, Path("dodo-report/ok"))
    run_report.write_summary(stream, [passed], {"ok": "ok"}, [], Verbosity.VERBOSE, {"ok": reported})
    used = "1.50 s of processor time (25 % of a processor), up to 150 MB of memory"
    assert stream.getvalue().splitlines()[2:11] == [
        "PASSED  ok    2.2 s    3.2 s  gap 0.5 m (at least 0.1 m)",
        "        reached it (set-up 1.0 s, ran 2.2 s)",
        "        ok   gap: 0.5 m (at least 0.1 m)",
        f"        steering: {used}",
        "        steering: warning: late�",
        "        steering: Traceback",
        "        steering:   File x",
        "        track: 2 earlier errors and warnings",
        "        track: error: no map",
    ]


GAP = with_margin({"name": "gap", "value": 0.0123, "limit": {"min": 0.0}, "unit": "m", "ok": True, "exclusive": True})
LONG = "with-a-name-that-leaves-no-room[light=dark]"


def rows(columns: int | None, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Of tests that passed, as a terminal of so many columns shows them, or a pipe."""
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(columns or 80))
    near = replace(PASSED, name="near", checks=(GAP,), sim_s=12.0)
    stream = StringIO() if columns is None else Terminal()
    run_report.write_summary(stream, [near, replace(near, name=LONG), PASSED], {}, [])
    return stream.getvalue().splitlines()[1:-2]


def test_the_table_fits_into_its_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """What has no room goes in turn: a name to a line of its own, the limit, and the end of the value."""
    head, near, *long, ok = rows(72, monkeypatch)
    assert (near, ok) == (
        "PASSED  near   12.0 s    3.2 s  gap 0.0123 m (more than 0 m)",
        "PASSED  ok      2.2 s    3.2 s  reached it",
    )
    assert long == [f"PASSED  {LONG}", near.replace("PASSED  near", " " * 12)]
    assert head == "        test     time     real  closest to failing"
    assert rows(50, monkeypatch)[1] == "PASSED  near   12.0 s    3.2 s  gap 0.0123 m"
    assert rows(38, monkeypatch)[1] == "PASSED  near   12.0 s    3.2 s  gap 0…"


def test_a_pipe_gets_whole_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    _, near, long, _ = rows(None, monkeypatch)
    assert len(long) == len(near) > 80
    assert long.startswith(f"PASSED  {LONG}   12.0 s    3.2 s  gap 0.0123 m (more than 0 m)")


def test_a_failure_says_what_where_and_which_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setenv("NO_COLOR", "1")
    (tmp_path / "drive.html").touch()
    places = {"evaluation.track": Place("a/b.dodo.yml", 7, 3), "evaluation.track.min-gap": Place("a/b.dodo.yml", 8, 9)}
    judge = PlannedService("evaluation", "track", "x", "x", (), (Flag("min-gap", "1"),), judge=True)
    tested = replace(plan(), services=(judge,), source_map=places)
    gap = {**GAP, "value": -1.0, "ok": False}
    verdict = {"evaluator": "track", "outcome": "failed", "reason": "hit"}
    failed = replace(OUTCOME, checks=(gap, {**GAP, "name": "held"}), reason="hit wall left " * 5, verdicts=(verdict,))
    error = replace(OUTCOME, slug="e", outcome="error", reason="service 'track' ended with exit code 2")
    stream, reported = Terminal(), Reported(tested, tmp_path, Path("dodo-report/test"))
    about = {"test": reported, "e": replace(reported, folder=tmp_path / "e", shown=Path("dodo-report/e"))}
    run_report.write_summary(stream, [error, failed, replace(failed, checks=())], {}, [], reported=about)
    assert stream.getvalue().splitlines()[1:10] == [
        "FAILED  test  hit wall left hit wall left hit wall left hit",
        "        wall left hit wall left",
        "        FAIL gap: -1 m (more than 0 m)",
        "        in a/b.dodo.yml:8:9",
        "        open dodo-report/test/drive.html",
        "FAILED  test  hit wall left hit wall left hit wall left hit",
        "        wall left hit wall left",
        "        in a/b.dodo.yml:7:3",
        "        open dodo-report/test/drive.html",
    ]
    assert stream.getvalue().splitlines()[10:13] == [
        "ERROR   test  service 'track' ended with exit code 2",
        "        in a/b.dodo.yml:7:3",
        "        open dodo-report/index.html",
    ]
