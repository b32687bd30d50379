"""What others say is shown as it is, on a terminal and off it."""

import io
import re

import pytest

from dodo_dsl.cli.progress_bar import progress_bar
from dodo_dsl.cli.run.progress import LiveProgress, PlainProgress
from tests.report.test_write import OUTCOME

SAID = (
    "device [/dev/ttyACM0] is gone",
    "[red]no colour is meant[/red]",
    "a [/] that closes nothing",
    ":warning: is no picture",
)


class Terminal(io.StringIO):
    """A stream that rich takes for a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal that takes every line whole, whatever these tests run in."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "xterm")


def shown(text: str) -> str:
    """Without what moves a terminal's cursor or colours it."""
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


@pytest.mark.parametrize("text", SAID)
def test_a_terminal_shows_what_was_said(text: str) -> None:
    terminal = Terminal()
    with LiveProgress(terminal, ["test", "other"]) as progress:
        progress.note(f"noted: {text}")
        progress.phase("test", f"phase: {text}")
        progress.rest(3.0, 2)
        progress.done(OUTCOME)
    with LiveProgress(terminal, ["test"]) as progress:
        progress.phase("test", f"phase: {text}")
    said = shown(terminal.getvalue())
    assert f"noted: {text}" in said
    assert f"phase: {text}" in said
    assert "2 tests to go, about 3 s" in said
    assert re.search(r"test +failed", said)


@pytest.mark.parametrize("text", SAID)
def test_a_bar_shows_a_files_name(text: str) -> None:
    terminal = Terminal()
    with progress_bar(terminal, f"reading {text}.rec", 3) as progress:
        progress(2)
    assert f"reading {text}.rec" in shown(terminal.getvalue())


@pytest.mark.parametrize("kind", [LiveProgress, PlainProgress])
def test_nothing_said_moves_the_cursor(kind: type[LiveProgress] | type[PlainProgress]) -> None:
    stream = Terminal()
    with kind(stream, ["test"]) as progress:
        progress.note("noted\x1b[2J\r::error::x")
        progress.phase("test", "phase\x1b[2J\r::error::x")
    assert "\x1b[2J" not in stream.getvalue()
    assert "noted�[2J�::error::x" in shown(stream.getvalue())
