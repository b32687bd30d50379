"""How much ``dodo compile`` says with ``-q``."""

import io
import shutil
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.package_data import registry

SPEC = """\
dodo: 1
name: drive
description: Drive to the finish line.
level: sil
kind: closed-loop
timeout: 60 s
clock: lockstep
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/straight, freq: 10 Hz}}
action:
  vehicle: {uses: dynamic-model}
  pose:    {uses: integrator, with: {yaw: 84 deg}}
evaluation:
  track: {uses: collision, with: {goal: finish, max-time: 40 s}}
"""


@pytest.fixture(autouse=True)
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(registry() / "maps/straight", "tests/maps/straight")
    Path("tests/drive").mkdir()
    Path("tests/drive/drive.dodo.yml").write_text(SPEC)
    sent = "opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest"
    service = f"image: x, command: --cid=111, x-dodo: {{in: [], out: [{sent}]}}"
    Path("compose.yml").write_text(f"services: {{app: {{{service}}}}}\n")
    Path("dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: compose.yml\n")


def compiled(*words: str) -> tuple[int, list[str]]:
    out = io.StringIO()
    code = main(["compile", *words], out, io.StringIO())
    return code, out.getvalue().splitlines()


def test_quiet_says_nothing_of_what_is_right() -> None:
    assert compiled("-q") == (0, [])
    assert compiled("--check", "-q") == (0, [])


def test_quiet_says_what_is_stale_and_what_is_wrong() -> None:
    compiled()
    Path("generated/drive/.env").write_text("")
    code, lines = compiled("--check", "-q")
    assert (code, lines[-1]) == (1, "1 test checked: generated is stale; dodo compile brings it up to date")
    Path("tests/drive/drive.dodo.yml").write_text(SPEC.replace("level: sil", "level: sli"))
    code, lines = compiled("--check", "-q")
    assert (code, lines[0].split()[1]) == (2, "error[wrong-value]:")
