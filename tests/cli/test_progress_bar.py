"""A progress bar is for terminals, and shows a file's name as it is."""

import io

import pytest

from dodo_dsl.cli.display import progress_bar
from tests.cli.terminal import SAID, Terminal, shown, wide


@pytest.mark.parametrize("text", SAID)
def test_a_bar_shows_a_files_name(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    wide(monkeypatch)
    terminal = Terminal()
    with progress_bar(terminal, f"reading {text}.rec", 3) as progress:
        progress(2)
    assert f"reading {text}.rec" in shown(terminal.getvalue())


def test_nothing_is_shown_elsewhere() -> None:
    stream = io.StringIO()
    with progress_bar(stream, "reading", 3) as progress:
        progress(2)
    assert stream.getvalue() == ""
