"""A maze of textured blocks: what hides what is drawn as ever, and what is hidden is not."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bench_camera import BLOCKS, make_maze, wander
from services.scene import scene as scenes
from services.scene import surfaces
from services.scene.render import Renderer
from services.scene.scene import load_scene

POSES = wander()[:6]


@pytest.fixture(scope="module")
def maze(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Renderer]:
    yield Renderer(load_scene(make_maze(tmp_path_factory.mktemp("maze"))), 320, 180, math.radians(48.8))


@pytest.mark.thorough
def test_hidden_faces_change_no_pixel(maze: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    found = [maze.render(pose) for pose in POSES]
    monkeypatch.setattr(surfaces, "_FEW", 1 << 30)
    for picture, pose in zip(found, POSES, strict=True):
        assert np.array_equal(picture, maze.render(pose))
    assert np.array_equal(found[0][..., 3], np.full((180, 320), 255))


def test_the_partition_cuts_few_faces(maze: Renderer) -> None:
    assert len(maze.scene.faces) == 6 * (BLOCKS + 2)
    assert len(maze._tree.faces) < 2 * len(maze.scene.faces)


def test_blocks_of_many_sizes_share_their_texture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "MAX_TEXTURE_BYTES", 1 << 28)
    faces = load_scene(make_maze(tmp_path)).faces
    textures = {face.paint.texture for face in faces if isinstance(face.paint, surfaces.TextureMap)}
    assert len(textures) == 2  # that of the floor and the ceiling is repeated more often
