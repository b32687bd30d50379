"""What the text alone of an OBJ file shows: before a library loads it, and without one."""

import functools
import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from dodo_dsl.opendlv.assets.json_file import MapError, read_bytes

MAX_BYTES = 16 << 20
MAX_TRIANGLES = 50_000
MAX_VERTICES = 4 * MAX_TRIANGLES
FARTHEST = 1e5
_FACE, _VERTEX = (re.compile(rb"^[ \t]*%b[ \t]" % letter, re.MULTILINE) for letter in (b"f", b"v"))
_RELATIVE_FACE = re.compile(rb"^\s*f\s[^#\n]*-\d", re.MULTILINE)
_CONTINUED = b"\\\n"
_THREE = 3

Vertex = tuple[float, ...]
Problem = tuple[int, str, str]
"""The line from 1, 0 for the whole file; what is wrong; and a hint."""


class _Wrong(Exception):
    """Carries a Problem."""


def check(path: Path, data: bytes) -> None:
    """Raises MapError for a file that is not a mesh, or unfolds to more than a mesh may have."""
    problem = problem_of(data)
    if problem is not None:
        line, what, hint = problem
        raise MapError(path, what, line=line, hint=hint)


@functools.lru_cache(maxsize=4)
def problem_of(data: bytes) -> Problem | None:
    """The first problem of an OBJ file's text."""
    if len(data) > MAX_BYTES:
        return 0, f"the OBJ file has {len(data)} bytes, expected at most {MAX_BYTES}", ""
    for pattern, what, most in ((_FACE, "triangles", MAX_TRIANGLES), (_VERTEX, "vertices", MAX_VERTICES)):
        count = sum(1 for _ in pattern.finditer(data))
        if count > most:
            return 0, f"{count} {what}, expected at most {most}", "save a simpler mesh"
    found = _RELATIVE_FACE.search(data)
    if found:
        line = data.count(b"\n", 0, data.index(b"f", found.start())) + 1
        return line, "faces count vertices by negative numbers, expected positive ones", "save the mesh again"
    if _CONTINUED in data:
        return None
    try:
        _read(data)
    except _Wrong as wrong:
        line, what, hint = wrong.args
        return line, what, hint
    return None


def outline(path: Path) -> list[tuple[float, float]]:
    """The convex outline of an OBJ file's faces from above, counter-clockwise in m; raises MapError."""
    points = sorted({(x, y) for x, y, *_ in _corners(path)})
    return [*_lower_half(points), *_lower_half(points[::-1])]


def _lower_half(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """From the first point to the last but one (Andrew 1979)."""
    kept: list[tuple[float, float]] = []
    for x, y in points:
        while len(kept) > 1 and _turn(kept[-2], kept[-1], (x, y)) <= 0.0:
            kept.pop()
        kept.append((x, y))
    return kept[:-1]


def _turn(a: Vertex, b: Vertex, c: Vertex) -> float:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _corners(path: Path) -> list[Vertex]:
    """The positions (x, y, z) of the vertices that an OBJ file's faces have, each once; raises MapError."""
    data = read_bytes(path)
    check(path, data)
    try:
        vertices, faces = _parsed(data.replace(_CONTINUED, b" "))
        used = {corner for face in faces for corner in face}
    except _Wrong as wrong:
        line, what, hint = wrong.args
        raise MapError(path, what, line=line, hint=hint) from None
    return [vertices[corner] for corner in sorted(used)]


def _parsed(data: bytes) -> tuple[list[Vertex], Iterator[list[int]]]:
    """The vertices, and the corners of each face."""
    lines = [(number, line.split()) for number, line in enumerate(data.split(b"\n"), 1) if line.strip()]
    vertices = [_vertex(number, words) for number, words in lines if words[0] == b"v"]
    return vertices, (_face(number, words, len(vertices)) for number, words in lines if words[0] == b"f")


def _read(data: bytes) -> None:
    vertices, faces = _parsed(data)
    count, has_area = 0, False
    for face in faces:
        count += 1
        has_area = has_area or any(_has_area([vertices[corner] for corner in part]) for part in _fan(face))
    if not count:
        raise _Wrong(0, "the OBJ file has no faces", "save the mesh with its faces, lines that begin with f")
    if not has_area:
        raise _Wrong(0, "no face of the OBJ file has an area", "save the mesh again: all its triangles are lines")


def _vertex(number: int, words: Sequence[bytes]) -> Vertex:
    try:
        place = tuple(float(word) for word in words[1:4])
    except ValueError:
        place = ()
    if len(place) < _THREE:
        commas = any(b"," in word for word in words)
        hint = (
            f"decimals have a point: write '{_text(words).replace(',', '.')}'"
            if commas
            else "for example 'v 0.1 0.2 0.3'"
        )
        raise _Wrong(number, f"'{_text(words)}' is not a vertex, expected v and three numbers in m", hint)
    if not all(abs(part) <= FARTHEST for part in place):
        raise _Wrong(number, "the OBJ file has vertices that are not finite numbers below 100 km", "save it in m")
    return place


def _face(number: int, words: Sequence[bytes], count: int) -> list[int]:
    """The indices of the corners, from 0."""
    ends = next((at for at, word in enumerate(words) if word.startswith(b"#")), len(words))
    try:
        corners = [int(word.partition(b"/")[0]) for word in words[1:ends]]
    except ValueError:
        corners = []
    if len(corners) < _THREE:
        hint = "for example 'f 1 2 3', the numbers of its vertices from 1"
        raise _Wrong(number, f"'{_text(words)}' is not a face, expected f and three or more vertices", hint)
    outside = next((corner for corner in corners if not 0 < corner <= count), None)
    if outside is not None:
        raise _Wrong(number, f"the face has vertex {outside}, expected 1 to {count}", "save the whole mesh again")
    return [corner - 1 for corner in corners]


def _text(words: Sequence[bytes]) -> str:
    return b" ".join(words).decode("ascii", "replace")[:40]


def _fan(corners: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    for second, third in itertools.pairwise(corners[1:]):
        yield corners[0], second, third


def _has_area(corners: Sequence[Vertex]) -> bool:
    """Whether a triangle is more than a line."""
    a, b, c = corners
    (ux, uy, uz), (vx, vy, vz) = ([q - p for p, q in zip(a, other, strict=True)] for other in (b, c))
    doubled = ((uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2) ** 0.5
    pairs = ((a, b), (b, c), (c, a))
    longest = max(sum((p - q) ** 2 for p, q in zip(*pair, strict=True)) for pair in pairs)
    return bool(doubled > 1e-6 * longest)
