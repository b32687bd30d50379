"""Small maps to draw."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

CUBE = """o cube
v -1 -1 0
v 1 -1 0
v 1 1 0
v -1 1 0
v -1 -1 2
v 1 -1 2
v 1 1 2
v -1 1 2
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""


def cube(half: float, height: float) -> str:
    """An OBJ of a box that stands on z = 0."""
    scale = {"-1": str(-half), "1": str(half), "0": "0", "2": str(height)}
    lines = CUBE.splitlines()
    return "\n".join(
        " ".join(["v", *(scale[part] for part in line.split()[1:])]) if line.startswith("v") else line for line in lines
    )


@pytest.fixture
def cube_obj() -> str:
    """A box of 2 m, eight corners and six sides."""
    return CUBE


@pytest.fixture
def write_map(tmp_path: Path) -> Callable[..., Path]:
    """Writes a map folder: its JSON, its OBJ files by name, its pictures by name."""

    def write(content: Any, objs: dict[str, str] | None = None, pictures: dict[str, np.ndarray] | None = None) -> Path:
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / "map.json").write_text(text)
        for name, obj in (objs or {"cube.obj": cube(0.5, 1.0)}).items():
            (tmp_path / name).write_text(obj)
        for name, picture in (pictures or {}).items():
            assert cv2.imwrite(str(tmp_path / name), picture)
        return tmp_path

    return write


@pytest.fixture
def cube_at(write_map: Callable[..., Path]) -> Callable[..., Path]:
    """A map of red cubes of 1 m, at [x, y, z, angle] each, on a plain white floor."""

    def write(*instances: list[float], half: float = 0.5, height: float = 1.0) -> Path:
        floor = {"name": "floor", "dimension": [90, 90, 1], "color": [1, 1, 1], "instances": [[0, 0, -0.5, 0]]}
        model = {"name": "cube", "file": "cube.obj", "color": [1, 0, 0], "instances": list(instances)}
        return write_map({"model": [model], "block": [floor]}, {"cube.obj": cube(half, height)})

    return write
