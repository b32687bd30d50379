"""The example of each README, which is that of the help, starts its service alone: ready, and ended by a signal."""

import re
import shlex
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

from services.base.flags import example_line, load_manifest
from tests.services.gantry.fake_rig import FakeRig
from tests.services.process import PATIENCE, ROOT

FOLDERS = sorted(path.parent for path in ROOT.glob("services/*/service.yml") if path.parent.name != "clock")
TROUBLE = re.compile("WARNING|ERROR|CRITICAL|Traceback")


OF_THEIR_LAYER = ("beacon", "collision", "rec_recorder", "virtual_camera")
"""Tried here; the others, which start in the same way, in their images too, and by ``make proof``."""
SHORT = [folder for folder in FOLDERS if folder.name in OF_THEIR_LAYER]
LONG = [folder for folder in FOLDERS if folder.name not in (*OF_THEIR_LAYER, "gantry")]


def name_of(folder: Path) -> str:
    return folder.name


def words_of(folder: Path, cid: int, place: Path) -> list[str]:
    """The example on another session, with other names of memories and files, so that examples do not meet."""
    manifest = load_manifest(folder)
    words = shlex.split(example_line(manifest))
    memories = [
        name for name, about in manifest["parameters"].items() if about["type"] == "memory" and about.get("default")
    ]
    moved = [f"--cid={cid}" if word.startswith("--cid=") else word.replace("=/tmp/", f"={place}/") for word in words]
    return [*moved, *(f"--{name}=dodo-test-{uuid.uuid4().hex[:8]}" for name in memories)]


def start(words: list[str], folder: Path) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, *words[1:]],
        cwd=ROOT,
        env={"PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ends_cleanly(process: "subprocess.Popen[str]") -> None:
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == '{"dodo": "ready"}\n', process.communicate(timeout=PATIENCE)[1]
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=PATIENCE)
        assert (process.returncode, out) == (0, "") and not TROUBLE.search(err), err
    finally:
        process.kill()
        process.communicate()


def test_all_services_are_tried() -> None:
    assert len(FOLDERS) == 19


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_readme_shows_the_example_of_the_help(folder: Path) -> None:
    lines = re.findall(r"^    (python -m services\..*)$", (folder / "README.md").read_text(), re.MULTILINE)
    assert lines == [example_line(load_manifest(folder))]


@pytest.mark.slow
@pytest.mark.parametrize("folder", [*SHORT, *(pytest.param(f, marks=pytest.mark.proof) for f in LONG)], ids=name_of)
def test_the_example_runs(folder: Path, cid: int, tmp_path: Path) -> None:
    ends_cleanly(start(words_of(folder, cid, tmp_path), tmp_path))


@pytest.mark.slow
def test_the_gantrys_example_runs(cid: int, tmp_path: Path) -> None:
    with FakeRig(tmp_path / "rig") as rig:
        words = [w.replace("/dev/ttyACM0", str(rig.path)) for w in words_of(ROOT / "services/gantry", cid, tmp_path)]
        ends_cleanly(start(words, tmp_path))
        assert rig.last() == "STOP"
