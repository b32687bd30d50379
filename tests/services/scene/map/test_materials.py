"""What modellers write into OBJ files, and the colours of their materials."""

import numpy as np
import pytest

from dodo_dsl.opendlv.assets import formats
from dodo_dsl.opendlv.assets.problem import InputError
from services.scene.meshes import load_obj
from services.scene.scene import load_scene
from tests.services.map_folders import CUBE
from tests.services.scene.draw.test_render import draw

PICTURE = np.zeros((8, 8, 3), np.uint8)
PICTURE[:4, :4], PICTURE[4:, 4:] = (0, 255, 0), (255, 0, 0)
"""Its upper left is green, its lower right blue, the rest black."""


def cornered(suffix: str, text: str = CUBE) -> str:
    lines = text.splitlines()
    return "\n".join(
        " ".join(w + suffix * (n > 0) for n, w in enumerate(s.split())) if s[0] == "f" else s for s in lines
    )


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + CUBE.removeprefix("o cube\n"),
        CUBE.replace("\n", "\r\n"),
        CUBE.replace("\n", "\r"),
        "# Blender\nmtllib none.mtl\ng side\ns off\nusemtl none\nvt 0 nan\nvn 0 0 1\nl 1 2\np 1\n" + cornered("/1/1"),
        "vt 0 0\n" + cornered("/1"),
        "vn 0 0 1\n" + cornered("//1"),
        "v 9 9 9\n"
        + CUBE.split("f ")[0]
        + "f -5 -6 -7 -8\nf -4 -3 -2 -1\n"
        + "f 2 3 7 6\nf 3 4 8 7\nf 4 5 9 8\nf 5 2 6 9",
        CUBE.replace("4 3 2 1", "4 3 \\\n2 1").replace("v 1 1 0", "v 1 \\\n1 0 # a corner"),
        CUBE.replace("f 4 3 2 1", "f 4 3 2\nf 4 2 1"),
    ],
)
def test_whatever_modellers_write_is_the_same_cube(text, tmp_path):
    for name, written in (("a.obj", text), ("b.obj", CUBE)):
        (tmp_path / name).write_bytes(written.encode())
    (vertices, triangles), expected = load_obj(tmp_path / "a.obj"), load_obj(tmp_path / "b.obj")
    sides = [{tuple(sorted(map(tuple, v[t].round(6)))) for t in each} for v, each in ((vertices, triangles), expected)]
    assert len(triangles) == 12 and {point for side in sides[0] for point in side} == {p for s in sides[1] for p in s}


LIBRARY = "newmtl red\r\nKd 1 0 0\r\n\nnewmtl tex\nKd 0.8\nmap_Kd -s 1 1 1 some\\a b.png\n"


def painted(library: str = "mtllib my set.mtl\n") -> str:
    """A cube of which -y is red, +x green and +y blue by its texture."""
    head, *faces = CUBE.split("f ")
    spots = "vt 0 0.51\nvt 0.49 0.99\nvt 2.51 0\nvt 2.99 0.49\n"
    materials = ["red", "red", "red", "tex", "tex", "red"]
    for number, (face, material) in enumerate(zip(faces, materials, strict=True)):
        corners = zip(face.split(), ("1", "2", "1", "2") if number == 3 else ("3", "4", "3", "4"), strict=True)
        faces[number] = f"usemtl {material}\nf {' '.join(f'{v}/{t}' for v, t in corners)}\n"
    return library + spots + head + "".join(faces)


@pytest.fixture
def folder(write_map, tmp_path):
    model = {"name": "cube", "file": "cube.obj", "instances": [[0, 0, 0, 3.141592653589793]]}
    (write_map({}) / "some").mkdir()
    (write_map({"model": [model]}, {"cube.obj": painted()}, {"some/a b.png": PICTURE}) / "my set.mtl").write_text(
        LIBRARY
    )
    return tmp_path


@pytest.mark.parametrize(
    ("place", "colour"), [((0, -6, 1.57), 2), ((6, 0, 3.14), 1), ((0, 6, -1.57), 0), ((0, -90, 1.57), 2)]
)
def test_a_camera_shows_faces_in_the_colours_of_their_materials(folder, place, colour):
    x, y, yaw = place
    pixel = draw(folder, x, y, 1.0, yaw=yaw)[238, 320, :3].astype(int)
    assert pixel[colour] > 150 and sum(pixel) == pixel[colour]
    assert list(formats.problems("map", folder, {}, {})) == []


@pytest.mark.parametrize(
    ("library", "materials", "said"),
    [
        ("", LIBRARY, r"cube.obj:15: material 'red' has no colour, and the map gives the model none"),
        ("mtllib none.mtl\n", LIBRARY, r"cube.obj:1: 'none.mtl' does not exist"),
        (f"mtllib {'ü' * 250}\n", LIBRARY, r"cube.obj:1: 'ü{125}' does not exist"),
        ("mtllib loop.mtl\n", LIBRARY, r"cube.obj:1: 'loop.mtl' does not exist"),
        (
            "mtllib my set.mtl\nvt 0 a\nusemtl tex\nf 1/1 2/1 3/1\n",
            LIBRARY,
            r"cube.obj:4: a corner's texture coordinate is not",
        ),
        (
            "mtllib my set.mtl\nusemtl tex\nf 1/99 2/1 3/1\n",
            LIBRARY,
            r"cube.obj:3: a corner's texture coordinate is not",
        ),
        ("mtllib ../my.mtl\n", LIBRARY, r"cube.obj:1: '../my.mtl' is not a file inside the map's folder"),
        ("mtllib /etc/passwd\n", LIBRARY, r"cube.obj:1: '/etc/passwd' is not a file inside"),
        ("mtllib my set.mtl\n", LIBRARY.replace("some\\", "..\\"), r"my set.mtl:6: '../a b.png' is not a file inside"),
        ("mtllib my set.mtl\n", LIBRARY.replace("a b", "c"), r"my set.mtl:6: 'some/c.png' does not exist"),
        ("mtllib my set.mtl\n", LIBRARY.replace("Kd 1 0 0", "Kd 1 0"), r"my set.mtl:2: 'Kd 1 0' is not a colour"),
        ("mtllib my set.mtl\n", LIBRARY.replace("Kd 1 0 0", "d 1"), r"cube.obj:16: material 'red' has no colour"),
    ],
)
def test_materials_that_are_none_are_told_by_the_check_and_the_camera(library, materials, said, folder):
    (folder / "cube.obj").write_text(painted(library))
    (folder / "my set.mtl").write_text(materials)
    (folder / "loop.mtl").symlink_to("loop.mtl")
    (problem,) = formats.problems("map", folder, {}, {})
    with pytest.raises(InputError, match=said) as caught:
        load_scene(folder)
    assert str(problem) == str(caught.value)
