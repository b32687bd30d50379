"""What others say is shown as it is, on a terminal and off it."""

import re

import pytest

from dodo_dsl.cli.run.progress import LiveProgress, PlainProgress, about, choose, count
from tests.cli.terminal import SAID, Terminal, shown, wide
from tests.report.test_report_folder import OUTCOME


@pytest.fixture(autouse=True)
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    wide(monkeypatch)
    return Terminal()


@pytest.mark.parametrize("text", SAID)
def test_a_terminal_shows_what_was_said(text: str, terminal: Terminal) -> None:
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


@pytest.mark.parametrize("kind", [LiveProgress, PlainProgress])
def test_nothing_said_moves_the_cursor(kind: type[LiveProgress] | type[PlainProgress], terminal: Terminal) -> None:
    with kind(terminal, ["test"]) as progress:
        progress.note("noted\x1b[2J\r::error::x")
        progress.phase("test", "phase\x1b[2J\r::error::x")
    assert "\x1b[2J" not in terminal.getvalue()
    assert "noted�[2J�::error::x" in shown(terminal.getvalue())


def test_a_stream_chooses_its_display(terminal: Terminal) -> None:
    assert isinstance(choose(terminal, ["test"]), LiveProgress)
    terminal.isatty = lambda: False  # type: ignore[method-assign]
    assert isinstance(choose(terminal, ["test"]), PlainProgress)


def test_counts_and_forecasts_in_words() -> None:
    assert [count(0), count(1), count(2), count(1, "stale test")] == ["0 tests", "1 test", "2 tests", "1 stale test"]
    assert [about(2.6), about(180), about(200)] == ["about 3 s", "about 180 s", "about 3 min"]
