"""What a shell gets as completions when it asks as argcomplete's scripts do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.cli import completion

ROOT = Path(__file__).parents[3]
_ASK = [sys.executable, "-c", "import os, sys; os.dup2(1, 8); from dodo_dsl.__main__ import run; run()"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = "kiwi: {kind: static, cid: 121, camera: {source: /dev/video0, width: 640, height: 480}}"
    (tmp_path / "dodo.yml").write_text(f'dodo: 1\nregistry: ["dodo:"]\nrigs: {{{rig}}}\n')
    monkeypatch.chdir(tmp_path)


def asked(line: str) -> list[str]:
    given = {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_COMP_WORDBREAKS": " \t\n\"'><;|&(",
        "COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9", "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    done = subprocess.run(_ASK, env={**os.environ, **given}, capture_output=True, text=True, check=False)
    return [word.strip().replace("\\", "") for word in done.stdout.splitlines()]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("dodo ru", ["run"]),
        ("dodo run sil-closed-l", ["sil-closed-left-curve"]),
        ("dodo run --backend m", ["mixed"]),
        ("dodo compile -", ["--format"]),
        ("dodo explain wrong-un", ["wrong-unit"]),
    ],
)
@pytest.mark.thorough
def test_a_line_goes_on(line: str, words: list[str]) -> None:
    assert set(words) <= set(asked(line))


def test_names_of_rigs_and_rules() -> None:
    assert completion.rigs() == ["emulated", "emulated-circle", "kiwi"]
    assert {"sil-perception", "wrong-unit"} <= set(completion.tests_and_rules(""))


def test_specs_are_completed_as_files() -> None:
    Path("mine").mkdir()
    for name in ("a.dodo.yml", "a.txt"):
        Path("mine", name).touch()
    assert completion.tests("mine/") == ["mine/a.dodo.yml"]
