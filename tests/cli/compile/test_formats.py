"""Formats of diagnostics, as their readers read them."""

import json
import shutil
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from tests.check import examples
from tests.cli.terminal import Terminal
from tests.emit.readers import run

WRONG = examples.SPEC.replace("name: example", "name: bad one").replace(
    "goal: finish", "goal: \\u00e9nd, matx-time: 1 s"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A test without problems, one with two errors, and one with a warning."""
    examples.write("", tmp_path)
    for name, text in (
        ("bad one", WRONG),
        ("warned", examples.SPEC.replace("example", "warned") + "matrix: {a: [1]}\n"),
    ):
        (tmp_path / "tests" / name).mkdir()
        (tmp_path / "tests" / name / f"{name}.dodo.yml").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("style", ["json", "gitlab"])
def test_nothing_else_is_on_standard_output(folder: Path, style: str) -> None:
    assert len(json.loads(run("compile", "--check", "--format", style)[1])) == 4


def test_fingerprints_stay_when_lines_move(folder: Path) -> None:
    def fingerprints() -> list[str]:
        return [found["fingerprint"] for found in json.loads(run("compile", "--check", "--format", "gitlab")[1])]

    before = fingerprints()
    (folder / "tests/bad one/bad one.dodo.yml").write_text(f"# a comment\n{WRONG}")
    assert fingerprints() == before and len({*before}) == len(before)


def test_a_report_s_text_is_in_the_log(folder: Path) -> None:
    """The standard output of a job goes into the report's file, so that the log would be empty."""
    code, text, _ = run("compile", "--check")
    assert "error[unknown-parameter]" in text
    assert "warning[unused-placeholder]" in text
    assert run("compile", "--check", "--format", "gitlab")[::2] == (code, text)
    assert run("compile", "--format", "gitlab")[2] == run("compile")[1]


@pytest.mark.thorough
def test_what_is_stale_is_in_the_log(folder: Path) -> None:
    shutil.rmtree(folder / "tests/bad one")
    assert run("compile")[0] == 0
    spec = folder / "tests/example/example.dodo.yml"
    spec.write_text(spec.read_text().replace("goal: finish", "goal: finish, max-time: 30 s"))
    code, text, _ = run("compile", "--check")
    assert code == 1
    assert "generated is stale; dodo compile brings it up to date\n" in text
    assert run("compile", "--check", "--format", "gitlab")[::2] == (1, text)


def test_a_report_on_a_terminal_stands_there_alone(folder: Path) -> None:
    stdout, stderr = Terminal(), StringIO()
    assert main(["compile", "--check", "--format", "gitlab"], stdout, stderr) == 2
    assert json.loads(stdout.getvalue())
    assert stderr.getvalue() == ""
