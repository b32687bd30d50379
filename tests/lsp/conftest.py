"""A repository with two tests and a map, and an editor that has opened it."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.lsp.editor import ROOT, Editor, editor

SPEC = """dodo: 1
name: sil-my-straight
description: Drive along a straight track to the finish line.
level: sil
kind: closed-loop
timeout: 60 s
clock: lockstep
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/straight, freq: 10 Hz, z: 9.5 cm}}
action:
  vehicle: {uses: dynamic-model}
  pose:
    uses: integrator
    with:
      yaw: 84 deg
evaluation:
  track: {uses: collision, with: {goal: finish, walls: [left, right], max-time: 40 s}}
"""
LONGER = """dodo: 1
name: sil-longer
extends: ../sil-my-straight/sil-my-straight.dodo.yml
evaluation:
  track: {with: {max-time: 50 s}}
"""
DEPLOYMENT = """dodo: 1
registry: [tests]
application: docker-compose.yml
rigs: {kiwi: {kind: static, cid: 121}}
"""
COMPOSE = """services:
  steering:
    image: registry.example.org/team/steering:latest
    command: "--cid=111 --name=video0.argb"
    x-dodo: {out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}
"""


class Repository:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.spec = folder / "tests" / "sil-my-straight" / "sil-my-straight.dodo.yml"
        self.longer = folder / "tests" / "sil-longer" / "sil-longer.dodo.yml"
        self.deployment = folder / "dodo.yml"
        self.map = folder / "tests" / "maps" / "straight" / "map.json"

    def write(self) -> None:
        for path, text in ((self.spec, SPEC), (self.longer, LONGER), (self.deployment, DEPLOYMENT)):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        (self.folder / "docker-compose.yml").write_text(COMPOSE)
        shutil.copytree(ROOT / "tests_registry" / "maps" / "straight", self.map.parent)


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Repository:
    found = Repository(tmp_path_factory.mktemp("repository").resolve())
    found.write()
    return found


@pytest.fixture(scope="module")
def opened(repository: Repository) -> Iterator[Editor]:
    """An editor with the test open, which has no problems."""
    with editor(repository.folder) as one:
        assert one.open(repository.spec) == []
        yield one
