"""OBJ files: their faces, and the materials of these, in one plain reader for the compiler and the services."""

import itertools
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.opendlv.assets.json_file import read_bytes
from dodo_dsl.opendlv.assets.problem import InputError

MAX_BYTES = 16 << 20
MAX_TRIANGLES = 50_000
MAX_VERTICES = 4 * MAX_TRIANGLES
FARTHEST = 1e5
_BOM, _CONTINUED = b"\xef\xbb\xbf", b"\\"

Vertex = tuple[float, float, float]
Triangle = tuple[int, int, int]


class Face(NamedTuple):
    """A polygon: its vertices and texture coordinates by their numbers from 0, and its material.

    Corners without texture coordinates have none.
    """

    line: int
    corners: list[int]
    spots: list[int]
    material: bytes


@dataclass
class Mesh:
    """What an OBJ file holds: vertices in m, texture coordinates as written, faces, and files of materials by line."""

    vertices: list[Vertex] = field(default_factory=list)
    spots: list[list[bytes]] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)
    libraries: list[tuple[int, bytes]] = field(default_factory=list)

    def triangles(self) -> tuple[list[Triangle], list[int]]:
        """Each with the number of its face; where all faces are quads their first halves come before the others."""
        found: list[tuple[Triangle, int]] = []
        for number, face in enumerate(self.faces):
            a, b, c, *more = face.corners
            if len(more) == 1:
                found += [((a, b, c), number), ((c, more[0], a), number)]
            else:
                found += [((a, second, third), number) for second, third in itertools.pairwise(face.corners[1:])]
        if all(len(face.corners) == 4 for face in self.faces):
            found = [*found[::2], *found[1::2]]
        return [triangle for triangle, _ in found], [number for _, number in found]


def read(path: Path) -> Mesh:
    """An OBJ file; raises InputError for one that is not a mesh, or has more than a mesh may have."""
    data = read_bytes(path)
    if len(data) > MAX_BYTES:
        raise InputError(path, f"the OBJ file has {len(data)} bytes, expected at most {MAX_BYTES}")
    mesh = _parsed(path, data)
    if not mesh.faces:
        raise InputError(path, "the OBJ file has no faces, lines that begin with f")
    if (count := sum(len(face.corners) - 2 for face in mesh.faces)) > MAX_TRIANGLES:
        raise InputError(path, f"{count} triangles, expected at most {MAX_TRIANGLES}: save a simpler mesh")
    return mesh


def outline(path: Path) -> list[tuple[float, float]]:
    """The convex outline of an OBJ file's faces from above, in m; raises InputError."""
    import shapely

    mesh = read(path)
    points = {mesh.vertices[corner][:2] for face in mesh.faces for corner in face.corners}
    ring = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(sorted(points))))
    return list(map(tuple, ring[: len(ring) - (len(ring) > 2)].tolist()))


def _lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """The words of each line that has some, with its number from 1; after a backslash a line goes on."""
    start, words, plain = 0, list[bytes](), data.removeprefix(_BOM).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    for number, line in enumerate(plain.split(b"\n"), 1):
        is_open = line.endswith(_CONTINUED)
        start, words = start or number, words + line.removesuffix(_CONTINUED).split()
        if words and not is_open:
            yield start, words
        start, words = (start, words) if is_open else (0, [])
    if words:
        yield start, words


def _parsed(path: Path, data: bytes) -> Mesh:
    mesh, material, faces = Mesh(), b"", list[tuple[int, list[bytes], bytes, int, int]]()
    for number, words in _lines(data):
        if words[0] == b"v":
            mesh.vertices.append(_vertex(path, number, words))
        elif words[0] == b"vt":
            mesh.spots.append(words[1:3])
        elif words[0] == b"f":
            faces.append((number, words, material, len(mesh.vertices), len(mesh.spots)))
        elif words[0] == b"usemtl":
            material = b" ".join(words[1:])
        elif words[0] == b"mtllib":
            mesh.libraries.append((number, b" ".join(words[1:])))
        for count, most, what in ((len(faces), MAX_TRIANGLES, "faces"), (len(mesh.vertices), MAX_VERTICES, "vertices")):
            if count > most:
                raise InputError(path, f"more than {most} {what}: save a simpler mesh", line=number)
    for number, words, material, *before in faces:
        mesh.faces.append(_face(path, number, words, material, mesh, before))
    return mesh


def _vertex(path: Path, number: int, words: Sequence[bytes]) -> Vertex:
    try:
        x, y, z = (float(word) for word in words[1:4])
    except ValueError:
        x = y = z = math.nan
    if not all(abs(part) <= FARTHEST for part in (x, y, z)):
        what = f"'{_text(words)}' is not a vertex, expected as 'v 0.1 0.2 0.3' numbers in m, below 100 km"
        raise InputError(path, what, line=number)
    return x, y, z


def _face(path: Path, number: int, words: Sequence[bytes], material: bytes, mesh: Mesh, before: Sequence[int]) -> Face:
    """Vertices and texture coordinates count from 1, or backwards from those ``before`` the face, from -1."""
    ends = next((at for at, word in enumerate(words) if word.startswith(b"#")), len(words))
    try:
        parts = [word.split(b"/") for word in words[1:ends]]
        corners = [int(part[0]) for part in parts]
        spots = [int(part[1]) for part in parts if len(part) > 1 and part[1]]
    except ValueError:
        corners, spots = [], []
    numbers = zip((corners, spots), before, strict=True)
    corners, spots = ([n + so_far if n < 0 else n - 1 for n in each] for each, so_far in numbers)
    if len(corners) < 3 or not all(0 <= each < len(mesh.vertices) for each in corners):
        known = f"of three or more of its {len(mesh.vertices)} vertices"
        raise InputError(path, f"'{_text(words)}' is not a face, expected as 'f 1 2 3' numbers {known}", line=number)
    return Face(number, corners, [each for each in spots if each >= 0], material)


def _text(words: Sequence[bytes]) -> str:
    return b" ".join(words).decode("ascii", "replace")[:40]


Paint = tuple[float, float, float] | Path
"""A colour as r, g, b from 0 to 1, or the file of a texture."""
_OPTION = re.compile(rb"-[a-z]+|on|off|[-+]?[0-9.]+|[rgbmlz]|sphere|cube_[a-z]+")
"""What may stand before the file of a texture."""


Spots = list[tuple[float, float]]
"""Texture coordinates u, v of a face's corners, v upwards; none unless each corner has them."""


def paints(path: Path, mesh: Mesh, folder: Path) -> list[tuple[Paint, Spots]]:
    """What each face is painted with by its material, of files in ``folder``, and where; raises InputError."""
    known: dict[bytes, Paint | None] = {}
    for line, names in mesh.libraries:
        for name in [names] if (path.parent / _name(names)).is_file() else names.split():
            known.update(_materials(_inside(folder, path, line, name), folder))
    hint = "the file of materials that mtllib names lacks it"
    for face in mesh.faces:
        if known.get(face.material) is None:
            what = f"material '{_text([face.material])}' has no colour, and the map gives the model none"
            raise InputError(path, what, line=face.line, hint=hint)
    painted = ((face, known[face.material]) for face in mesh.faces)
    return [(p, _spots(path, mesh, face) if isinstance(p, Path) else []) for face, p in painted if p is not None]


def _spots(path: Path, mesh: Mesh, face: Face) -> Spots:
    if len(face.spots) < len(face.corners):
        return []
    try:
        found = [(float(u), float(v)) for u, v, *_ in ((*mesh.spots[each], b"0") for each in face.spots)]
    except (ValueError, IndexError):
        found = [(math.nan, math.nan)]
    if not all(map(math.isfinite, itertools.chain(*found))):
        what = "a corner's texture coordinate is not in the file, expected a line 'vt' with two numbers"
        raise InputError(path, what, line=face.line, hint="save the whole mesh again")
    return found


def _name(name: bytes) -> str:
    return name[:250].decode(errors="ignore").replace("\\", "/").replace("\0", "")


def _inside(folder: Path, file: Path, line: int, name: bytes) -> Path:
    found = Path(os.path.realpath(file.parent / _name(name)))  # which takes links that never end, too
    if not found.is_relative_to(folder.resolve()):
        hint = "copy it there: the map's folder goes with the test"
        raise InputError(file, f"'{_name(name)}' is not a file inside the map's folder", line=line, hint=hint)
    if not found.is_file():
        raise InputError(file, f"'{_name(name)}' does not exist", line=line, hint="put it into the map's folder")
    return found


def _materials(file: Path, folder: Path) -> Iterator[tuple[bytes, Paint | None]]:
    """The materials of an MTL file: a texture (map_Kd), the colour without one (Kd), or None; raises InputError."""
    name, is_texture = b"", False
    for line, words in _lines(read_bytes(file)):
        key = words[0].lower()
        if key == b"newmtl":
            name, is_texture = b" ".join(words[1:]), False
            yield name, None
        elif key == b"map_kd":
            is_texture = True
            texture = itertools.dropwhile(_OPTION.fullmatch, words[1:])
            yield name, _inside(folder, file, line, b" ".join(texture))
        elif key == b"kd" and not is_texture:
            try:
                grey = 3 if len(words) == 2 else 1
                red, green, blue = (min(max(0.0, float(word)), 1.0) for word in words[1:4] * grey)
            except ValueError:
                what = f"'{_text(words)}' is not a colour, expected Kd and three numbers from 0 to 1"
                raise InputError(file, what, line=line) from None
            yield name, (red, green, blue)
