import math

import numpy as np
import pytest
import trimesh

from services.scene.meshes import is_closed, load_obj
from services.scene.shape import make_shape


def cylinder(sides: int, radius: float = 0.5, height: float = 2.0) -> str:
    turns = [2 * math.pi * i / sides for i in range(sides)]
    lines = [f"v {radius * math.cos(t)} {radius * math.sin(t)} {z}" for z in (0, height) for t in turns]
    lines += [f"f {i + 1} {(i + 1) % sides + 1} {(i + 1) % sides + 1 + sides} {i + 1 + sides}" for i in range(sides)]
    caps = [" ".join(map(str, range(sides, 0, -1))), " ".join(map(str, range(sides + 1, 2 * sides + 1)))]
    return "\n".join([*lines, *("f " + cap for cap in caps)]) + "\n"


@pytest.fixture
def obj(tmp_path):
    def write(text):
        (tmp_path / "a.obj").write_text(text)
        return tmp_path / "a.obj"

    return write


def test_a_box_becomes_six_faces_that_look_outwards(obj, cube_obj):
    vertices, triangles = load_obj(obj(cube_obj))
    assert (vertices.shape, triangles.shape) == ((8, 3), (12, 3))
    shape = make_shape(vertices, triangles)
    assert sorted(shape.areas) == pytest.approx([4.0] * 6)
    assert (np.einsum("fi,fi->f", shape.normals, shape.centres - shape.middle) > 0).all()
    assert np.abs(shape.mitres) == pytest.approx(np.ones((8, 3)))
    assert shape.radius == pytest.approx(math.sqrt(3))


def test_a_box_that_is_inside_out_is_turned(obj, cube_obj):
    flipped = [f"f {' '.join(reversed(s.split()[1:]))}" if s[0] == "f" else s for s in cube_obj.splitlines()]
    vertices, triangles = load_obj(obj("\n".join(flipped)))
    assert trimesh.Trimesh(vertices, triangles, process=False).volume == pytest.approx(8.0)


def test_an_open_surface_shows_from_both_sides(obj):
    vertices, triangles = load_obj(obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"))
    normals = make_shape(vertices, triangles).normals
    assert sorted(normals[:, 2]) == [-1.0, 1.0]


def test_a_fine_solid_of_revolution_gets_sixteen_sides(obj):
    vertices, triangles = load_obj(obj(cylinder(96)))
    assert (len(vertices), is_closed(vertices, triangles)) == (32, True)
    assert np.hypot(vertices[:, 0], vertices[:, 1]) == pytest.approx(np.full(32, 0.5))
    assert trimesh.Trimesh(vertices, triangles, process=False).volume == pytest.approx(
        2.0 * 8 * 0.25 * math.sin(math.pi / 8)
    )


def test_a_fine_prism_that_is_not_round_keeps_its_corners(obj):
    squashed = [
        f"v {float(p[1]) * 2} {p[2]} {p[3]}" if (p := s.split())[0] == "v" else s for s in cylinder(96).splitlines()
    ]
    assert len(load_obj(obj("\n".join(squashed)))[0]) == 192
