"""The end of a run in words."""

from dataclasses import replace
from io import StringIO
from pathlib import Path

from dodo_dsl.cli import run_report
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.outcome import NotRun, ServiceUse
from tests.report.test_report_folder import OUTCOME

PASSED = replace(OUTCOME, name="ok", slug="ok", outcome="passed", reason="reached it", setup_s=1.0, execution_s=2.25)


def text(outcomes: list[object], tests: dict[str, str], skipped: tuple[NotRun, ...] = ()) -> str:
    stream = StringIO()
    run_report.write_summary(stream, outcomes, tests, skipped)  # type: ignore[arg-type]
    return stream.getvalue()


def test_a_line_each_with_what_explains_it() -> None:
    failed = replace(OUTCOME, notes=("a note",), last_lines=("the last\x1b",))
    assert text([PASSED, failed], {"ok": "ok", "test": "test"}) == (
        "\nPASSED  ok    reached it (set-up 1.0 s, ran 2.2 s)\n"
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
    assert shown.endswith("6 tests not run, as the run was interrupted: a, b, c, d, e and 1 more\n")


def test_quiet_names_only_what_did_not_pass() -> None:
    stream = StringIO()
    run_report.write_summary(stream, [PASSED, OUTCOME], {"ok": "ok", "test": "test"}, [], Verbosity.QUIET)
    assert stream.getvalue() == "FAILED  test  hit wall\n1 passed, 1 failed, 0 in error\n"


def test_verbose_shows_checks_use_and_what_services_complained_of(tmp_path: Path) -> None:
    (tmp_path / "application.steering.log").write_text("frame 0\nwarning: late\x07\nTraceback\n  File x\n")
    (tmp_path / "evaluation.track.log").write_text('{"dodo": "ready"}\n' + "error: no map\n" * 22)
    passed = replace(PASSED, checks=({"name": "gap", "value": 0.5, "limit": {"min": 0.1}, "unit": "m", "ok": True},))
    passed = replace(passed, resources=(ServiceUse("steering", 1.5, 0.25, 150_000_000, 5e6, None),))
    stream = StringIO()
    run_report.write_summary(stream, [passed], {"ok": "ok"}, [], Verbosity.VERBOSE, {"ok": tmp_path})
    used = "1.50 s of processor time (25 % of a processor), up to 150 MB of memory, growing by 300 MB/min"
    assert stream.getvalue().splitlines()[2:9] == [
        "        ok   gap: 0.5 m (at least 0.1 m)",
        f"        steering: {used}",
        "        steering: warning: late�",
        "        steering: Traceback",
        "        steering:   File x",
        "        track: 2 earlier errors and warnings",
        "        track: error: no map",
    ]
