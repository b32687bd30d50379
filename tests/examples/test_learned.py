"""The learned driver learns from recorded drives, and drives by it."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl import package_data

ROOT = Path(__file__).resolve().parents[2]
DODO = [sys.executable, "-m", "dodo_dsl"]


def call(folder: Path, *words: str) -> str:
    """What the command printed, which has to succeed."""
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def learned(folder: Path, recordings: list[str]) -> list[float]:
    """Errors in rad of what it learns: of the drives, of those it has not seen, and of steering straight on."""
    for name in recordings:
        for kind in ("--frames", "--csv"):
            call(folder, *DODO, "rec", "export", name, kind, "-o", f"drives/{name}")
    said = call(folder / "learned", sys.executable, "train.py", "../drives", "model.npz")
    return [float(text) for text in re.findall(r"(0\.\d+) rad", said)]


def passed(folder: Path, test: str) -> None:
    """It drives a test by what it has learned."""
    words = ["run", test, "--application", "learned/docker-compose.yml", "--report", "learned-report"]
    call(folder, *DODO, *words)
    (found,) = json.loads((folder / "learned-report" / "results.json").read_text())["tests"]
    assert found["outcome"] == "passed", found["reason"]


@pytest.mark.slow
def test_it_learns_a_recording_by_heart(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples" / "learned", tmp_path / "learned")
    (tmp_path / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:"]\n')
    for name in ("one.rec", "same.rec"):
        shutil.copy(package_data.registry() / "recordings" / "kiwi-track.rec", tmp_path / name)
    errors = learned(tmp_path, ["one.rec", "same.rec"])
    assert errors[0] < errors[2] / 10
    passed(tmp_path, "dil-kiwi-track")
