import math

import numpy as np
import pytest
import trimesh

from services.scene.meshes import is_closed, load_obj, oriented
from services.scene.shape import convex_parts, join, make_shape


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


def test_corners_that_a_file_repeats_are_welded(obj, cube_obj):
    again = cube_obj + "\n".join(
        " ".join(["f", *(str(int(i) + 8) for i in s.split()[1:])]) if s[0] == "f" else s for s in cube_obj.splitlines()
    )
    assert load_obj(obj(again))[0].shape == (8, 3)


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


def test_joined_polygons_cover_what_the_triangles_did(obj):
    vertices, triangles = load_obj(obj(cylinder(16)))
    loops, normals, _ = join(vertices, triangles)
    assert max(map(len, loops)) <= 8
    assert len(loops) < 16 + 2 * 4
    shape = make_shape(vertices, oriented(vertices, triangles))
    cap = 8 * 0.25 * math.sin(math.pi / 8)
    assert float(shape.areas[shape.normals[:, 2] > 0.9].sum()) == pytest.approx(cap)
    assert float(shape.areas.sum()) == pytest.approx(2 * cap + 2.0 * 16 * math.sin(math.pi / 16))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(loops)))


def stepped(radii, heights) -> str:
    """A tower of rings of sixteen corners."""
    turns = [2 * math.pi * i / 16 for i in range(16)]
    lines = [f"v {r * math.cos(t)} {r * math.sin(t)} {z}" for r, z in zip(radii, heights, strict=True) for t in turns]
    for ring in range(len(radii) - 1):
        lines += [
            f"f {ring * 16 + i + 1} {ring * 16 + (i + 1) % 16 + 1} {ring * 16 + (i + 1) % 16 + 17} {ring * 16 + i + 17}"
            for i in range(16)
        ]
    top = 16 * (len(radii) - 1)
    lines += ["f " + " ".join(map(str, range(16, 0, -1))), "f " + " ".join(str(top + i + 1) for i in range(16))]
    return "\n".join(lines)


def test_a_cone_on_a_plate_has_two_convex_parts_and_a_box_one(obj, cube_obj):
    assert [len(part) for part in convex_parts(*load_obj(obj(cube_obj)))] == [8]
    parts = convex_parts(*load_obj(obj(stepped([4, 4, 3, 1], [0, 1, 1, 9]))))
    assert sorted(len(part) for part in parts) == [32, 48]
