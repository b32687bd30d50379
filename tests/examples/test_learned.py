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
HEADING = [66, 74]
STARTS = [pytest.param([6], id="two drives"), pytest.param([-6, -2, 2, 6], id="eight")]


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


def learned(folder: Path, recordings: list[str], validation: str) -> list[float]:
    """Errors in rad of what it learns: of the pairs, of those it has not seen, and of steering straight on."""
    call(folder, *DODO, "rec", "export", *recordings, "--steering", "-o", "pairs", "--validation", validation)
    said = call(folder / "learned", sys.executable, "train.py", "../pairs", "model.npz")
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
    errors = learned(tmp_path, ["one.rec", "same.rec"], "50%")
    assert errors[0] < errors[2] / 10
    passed(tmp_path, "dil-kiwi-track")


@pytest.mark.slow
@pytest.mark.proof
@pytest.mark.parametrize("starts", STARTS)
def test_it_learns_from_drives_and_drives(tmp_path: Path, starts: list[int]) -> None:
    collect(tmp_path, starts)
    call(tmp_path, *DODO, "run", "sil-collect", "--application", "kiwi/docker-compose.yml")
    recordings = sorted(str(path) for path in tmp_path.glob("dodo-report/*/test.rec"))
    assert len(recordings) == len(starts) * len(HEADING)
    errors = learned(tmp_path, recordings, "25%")
    assert errors[1] < errors[2] / 2, errors
    passed(tmp_path, "sil-closed-straight")
