"""Streams that are closed and paths in another encoding get a sentence."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hostile.command import dodo
from tests.rec.conftest import video

ROOT = Path(__file__).parents[2]


def run(*words: str, shell: str = "") -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "dodo_dsl", *words]
    if shell:
        command = ["sh", "-c", f'exec "$@" {shell}', "sh", *command]
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, errors="surrogateescape", check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shell", "code", "said"),
    [
        (">&-", 3, "dodo: standard output is closed, redirect it to /dev/null instead\n"),
        (">&- 2>&-", 3, ""),
        ("2>&-", 3, ""),
        (">/dev/full", 3, "No space left on device\n"),
        ("<&-", 0, ""),
    ],
)
def test_streams_that_are_closed_or_full(shell: str, code: int, said: str) -> None:
    """A closed or full standard stream is a sentence, and no traceback."""
    result = run("list", shell=shell)
    assert (result.returncode, result.stderr.endswith(said)) == (code, True), result.stderr
    assert "Traceback" not in result.stderr and "Exception ignored" not in result.stderr


@pytest.mark.thorough
def test_paths_that_are_not_utf_8(tmp_path: Path, record: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command takes paths that are not UTF-8."""
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe"))
    folder.mkdir()
    monkeypatch.chdir(folder)
    drive = record(video(1)).rename(folder / "drive.rec")
    (folder / "dodo.yml").write_text(f"dodo: 1\napplication: {ROOT}/examples/kiwi/docker-compose.yml\n")
    commands = (
        ("rec", "info", drive), ("rec", "info", drive, "--json"), ("rec", "cut", drive, "-o", folder / "new.rec"),
        ("rec", "export", drive, "--csv"), ("rec", "export", drive, "--coco", "-o", folder / "coco"),
        ("judge", drive, "--spec", "sil-closed-straight"), ("list", "--json"), ("compile", "--check", folder),
        ("compile", "sil-closed-straight", "-o", folder / "generated"), ("new", "sil-mine"), ("report", folder),
        ("compile", "--check", folder / "none"), ("explain", str(folder / "none")),
    )  # fmt: skip
    for words in commands:
        code, output = dodo(*map(str, words))
        assert code in (0, 1, 2, 3), words
        assert "Traceback" not in output and "internal error" not in output, (words, output)
        output.encode()  # a terminal takes it
