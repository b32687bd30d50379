"""When output has colours, and that they change nothing else."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli import display, run_report
from dodo_dsl.cli.main import main
from dodo_dsl.cli.progress import PlainProgress, choose
from dodo_dsl.cli.uninterrupted import UninterruptedStream
from dodo_dsl.diagnostics import Diagnostic, Span, format_text
from dodo_dsl.terminal import harmless_stream
from tests.cli.terminal import Terminal, shown
from tests.report.test_report_folder import OUTCOME

GREEN, RED = "\x1b[32m", "\x1b[31m"


@pytest.fixture(autouse=True)
def plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")


@pytest.mark.parametrize(
    ("stream", "variables", "wanted"),
    [
        (Terminal, {}, True),
        (StringIO, {}, False),
        (Terminal, {"TERM": "dumb"}, False),
        (Terminal, {"NO_COLOR": "1"}, False),
        (Terminal, {"NO_COLOR": ""}, True),
        (StringIO, {"FORCE_COLOR": "1"}, True),
        (StringIO, {"FORCE_COLOR": ""}, False),
        (Terminal, {"FORCE_COLOR": "1", "TERM": "dumb"}, True),
        (Terminal, {"NO_COLOR": "1", "FORCE_COLOR": "1"}, False),
    ],
)
def test_the_variables_that_decide(
    stream: type[StringIO], variables: dict[str, str], wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    made = stream()
    display.write_coloured(made, [("ok", "passed")])
    assert made.getvalue() == (f"{GREEN}ok\x1b[0m" if wanted else "ok")


def test_a_harmless_stream_lets_colours_through_and_nothing_of_others() -> None:
    terminal = Terminal()
    stream = UninterruptedStream(harmless_stream(terminal))
    display.write_coloured(stream, [("\x1b[2Jgone", "failed"), ("\n", ""), ("::error::x", "hint")])  # type: ignore[arg-type]
    assert terminal.getvalue() == f"{RED}�[2Jgone\x1b[0m\n\x1b[36m: :error::x\x1b[0m"


def test_a_summary_says_the_same_with_colours() -> None:
    terminal, file = Terminal(), StringIO()
    for stream in (terminal, file):
        run_report.write_summary(stream, [OUTCOME], [])
    assert RED in terminal.getvalue()
    assert shown(terminal.getvalue()) == file.getvalue()
    assert GREEN not in terminal.getvalue(), "there is no test that passed"


def test_diagnostics_say_the_same_with_colours(tmp_path: Path) -> None:
    (tmp_path / "a.yml").write_text("name: x\n")
    found = [Diagnostic(Span(str(tmp_path / "a.yml"), 1, 7), "a-rule", "wrong", "write y")]
    terminal = Terminal()
    display.write_diagnostics(terminal, found)
    assert "\x1b[1;31merror[a-rule]\x1b[0m: wrong\n" in terminal.getvalue()
    assert shown(terminal.getvalue()) == format_text(found)


def test_what_programs_read_has_no_colours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FORCE_COLOR", "1")
    (tmp_path / "bad.dodo.yml").write_text("dodo: 1\nname: bad\n")
    stdout = StringIO()
    assert main(["compile", "--check", "bad.dodo.yml", "--format", "json"], stdout, StringIO()) == 2
    assert "bad.dodo.yml" in stdout.getvalue()
    assert "\x1b" not in stdout.getvalue()


def test_a_terminal_that_cannot_move_its_cursor_gets_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    assert isinstance(choose(Terminal(), ["test"]), PlainProgress)


def test_lines_of_progress_have_coloured_verdicts() -> None:
    terminal = Terminal()
    with PlainProgress(terminal, ["test"]) as progress:
        progress.done(OUTCOME)
    assert terminal.getvalue().endswith(f"s] test  {RED}failed\x1b[0m: hit wall\n")
