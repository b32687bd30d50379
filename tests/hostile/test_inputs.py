"""Input is a file: no command waits for a FIFO or reads a device."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hostile.command import dodo
from tests.rec.conftest import video

READERS = {
    "info": ("rec", "info", "{}"),
    "cut": ("rec", "cut", "{}", "-o", "new.rec"),
    "export": ("rec", "export", "{}", "--csv"),
    "messages": ("rec", "info", "drive.rec", "--messages", "{}"),
    "judge": ("judge", "{}", "--spec", "sil-closed-straight"),
    "application": ("compile", "--check", "--application", "{}"),
    "spec": ("compile", "--check", "{}"),
}
"""Commands that read a file; each has to end at once, with a sentence that names it."""


@pytest.mark.parametrize("kind", ["fifo", "socket", "link", "device"])
@pytest.mark.parametrize("reader", READERS)
def test_input_is_a_file(
    record: Callable[..., Path], strange: dict[str, Path], kind: str, reader: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No command reads a FIFO, a socket or a device."""
    folder = record(video(1)).parent
    monkeypatch.chdir(folder)
    (folder / "dodo.yml").write_text("dodo: 1\n")
    code, output = dodo(*(word.format(strange[kind]) for word in READERS[reader]))
    assert code in (2, 3), output
    assert "strange-" in output and "Traceback" not in output and "internal error" not in output


@pytest.mark.parametrize("kind", ["fifo", "socket", "folder", "device"])
@pytest.mark.parametrize("name", ["results.json", "test.json", "dodo.yml"])
def test_files_that_are_found_are_files(
    strange: dict[str, Path], tmp_path: Path, kind: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor where it looks for its input itself."""
    monkeypatch.chdir(tmp_path)
    strange[kind].rename(tmp_path / name)
    words = {"results.json": ("report", "."), "test.json": ("run", "--compiled", "."), "dodo.yml": ("list",)}[name]
    code, output = dodo(*words)
    assert "Traceback" not in output and "internal error" not in output
    assert code == 2 or name == "dodo.yml", output
