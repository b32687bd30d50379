"""What commands say about what they do otherwise than a reader of the command line expects."""

import os
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.compiler import load

ROOT = Path(__file__).parents[2]
HIL = sum(spec.level == "hil" for spec in load([ROOT / "tests_registry"]).specs)


def test_without_rigs_the_emulated_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stdout = StringIO()
    assert main(["rig", "status"], stdout, StringIO()) == 0
    assert stdout.getvalue() == "dodo.yml has no rigs; every machine has 'emulated': dodo rig status emulated\n"
    stdout = StringIO()
    assert main(["rig", "status", "--json"], stdout, StringIO()) == 0
    assert stdout.getvalue() == "[]\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--clock", "lockstep"], "note: hil-dynamic runs in real time, as hardware does not wait\n"),
        (
            ["hil-*", "--clock", "lockstep"],
            f"note: hil-camera and {HIL - 1} more run in real time, as hardware does not wait\n",
        ),
        ([], ""),
    ],
)
def test_hardware_keeps_its_clock_and_it_is_said(tmp_path: Path, words: list[str], said: str) -> None:
    """Without an application nothing is run, but the command line is read."""
    (tmp_path / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:"]\n')
    names = [] if words and words[0].startswith("hil") else ["hil-dynamic"]
    command = [sys.executable, "-m", "dodo_dsl", "run", *names, *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout) == (2, said)
    assert result.stderr.startswith("dodo run: no application; ")


def test_who_cannot_be_a_process_is_told_what_to_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["new", "--deployment"], ["new", "mine"]):
        assert main(words, StringIO(), StringIO()) == 0
    command = [sys.executable, "-m", "dodo_dsl", "run", "mine", "--backend", "process"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (
        2,
        "dodo run: application service 'application' has no 'x-dodo-process', which the process backend needs; "
        "add for example 'x-dodo-process: [python, main.py]', or run with --backend docker\n",
    )
