"""The example application, and copies of it that are wrong in one way."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from tests.realtime import hurry

ROOT = Path(__file__).parents[2]
KIWI = ROOT / "examples" / "kiwi"

TOLD = {
    "in": ["opendlv.sim.Frame"],
    "out": ["opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"],
}
"""``x-dodo`` of an application that declares to take its true pose."""


def dodo(*words: str, code: int | tuple[int, ...], before: Sequence[str] = (), folder: Path = ROOT) -> str:
    """The output of a command, after the words ``before`` it, that must end with an exit code, or one of some."""
    command = [*before, sys.executable, "-m", "dodo_dsl", *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    hurry(process.pid)
    try:
        output, _ = process.communicate(timeout=600)
    finally:
        process.kill()
    assert process.returncode in (code if isinstance(code, tuple) else (code,)), output
    assert "Traceback" not in output, output
    return output


def results(report: Path) -> dict[str, dict[str, Any]]:
    return {t["slug"]: t for t in json.loads((report / "results.json").read_text())["tests"]}


def program(folder: Path, *process: str, command: str = "", **about: Any) -> Path:
    """The compose file of an application of one program, with words for its command and keys of its service."""
    service = {"image": "x", "command": f"--cid=111 --name=video0.argb {command}", "x-dodo-process": [*process]}
    path = folder / "docker-compose.yml"
    path.write_text(yaml.safe_dump({"services": {"app": {**service, **about}}}))
    return path


def kiwi(folder: Path, wrong: tuple[str, str, str] | None = None, **commands: str) -> Path:
    """A copy of the example application, wrong in one place, with words appended to its services' commands."""
    shutil.copytree(KIWI, folder)
    if wrong:
        name, right, changed = wrong
        text = (folder / name).read_text()
        assert text.count(right) == 1
        (folder / name).write_text(text.replace(right, changed))
    path = folder / "docker-compose.yml"
    compose = yaml.safe_load(path.read_text())
    for service, words in commands.items():
        compose["services"][service]["command"] += f" {words}"
    path.write_text(yaml.safe_dump(compose))
    return path
