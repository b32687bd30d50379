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
HEADING = [80, 88]
STARTS = [pytest.param([8], id="two drives"), pytest.param([-7, -2, 3, 8], id="eight", marks=pytest.mark.proof)]


def call(folder: Path, *words: str) -> str:
    """What the command printed, which has to succeed."""
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def collect(folder: Path, starts: list[int]) -> None:
    """The shipped test from several starts, with all its pictures kept."""
    shutil.copytree(package_data.registry() / "maps" / "straight", folder / "tests" / "maps" / "straight")
    spec = (package_data.registry() / "sil-closed-straight" / "sil-closed-straight.dodo.yml").read_text()
    matrix = f"matrix:\n  start: {[f'{s} cm' for s in starts]}\n  heading: {[f'{h} deg' for h in HEADING]}\n"
    spec, changes = re.subn(r"vary:\n(?:  .*\n)+", f"{matrix}record: {{frames: always, rate: 10 Hz}}\n", spec)
    assert changes == 1
    spec, changes = re.subn(r"response: .*\n", "", spec)  # drives for their pictures, whatever time an answer takes
    assert changes == 1
    spec = spec.replace("name: sil-closed-straight", "name: sil-collect").replace("vary.", "matrix.")
    (folder / "tests" / "sil-collect").mkdir()
    (folder / "tests" / "sil-collect" / "sil-collect.dodo.yml").write_text(spec)
    (folder / "dodo.yml").write_text('dodo: 1\nregistry: [tests, "dodo:"]\n')
    for name in ("kiwi", "learned"):
        shutil.copytree(ROOT / "examples" / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))


@pytest.mark.slow
@pytest.mark.parametrize("starts", STARTS)
def test_it_learns_from_drives_and_drives(tmp_path: Path, starts: list[int]) -> None:
    collect(tmp_path, starts)
    call(tmp_path, *DODO, "run", "sil-collect", "--application", "kiwi/docker-compose.yml")
    recordings = sorted(str(path) for path in tmp_path.glob("dodo-report/*/test.rec"))
    assert len(recordings) == len(starts) * len(HEADING)
    call(tmp_path, *DODO, "rec", "export", *recordings, "--steering", "-o", "pairs", "--validation", "25%")
    said = call(tmp_path / "learned", sys.executable, "train.py", "../pairs", "model.npz")
    errors = [float(text) for text in re.findall(r"(0\.\d+) rad", said)]
    assert errors[1] < errors[2] / 2, said
    words = ["run", "sil-closed-straight", "--application", "learned/docker-compose.yml", "--report", "learned-report"]
    call(tmp_path, *DODO, *words)
    (test,) = json.loads((tmp_path / "learned-report" / "results.json").read_text())["tests"]
    assert test["outcome"] == "passed", test["reason"]
