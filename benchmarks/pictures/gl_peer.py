"""The virtual camera's peer: the same maps drawn by OpenGL, which on machines without a graphics card is llvmpipe.

Needs the package moderngl (pip) and EGL (Debian: libegl1, libegl-mesa0, libgl1-mesa-dri). Of the service it uses the
reader of maps, and nothing that draws.
"""

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets.map_file import BlockEntry, Instance, ModelEntry, read_map

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

SKY, GROUND = (176, 190, 206), (116, 114, 112)
LIGHT = np.array([-0.35, -0.25, 0.9])
AMBIENT = 0.62
NEAR, FAR = 0.01, 2000.0
VERTEX = """
#version 330
uniform mat4 camera;
in vec3 position; in vec3 tint; in vec2 spot;
flat out vec3 colour; out vec2 tile;
void main() { gl_Position = camera * vec4(place, 1.0); colour = tint; tile = spot; }
"""
FRAGMENT = """
#version 330
uniform sampler2D image; uniform bool textured;
flat in vec3 colour; in vec2 tile;
out vec4 pixel;
void main() { pixel = vec4((textured ? texture(picture, tile).rgb : colour).bgr, 1.0); }
"""


def rotation(angle: float) -> Array:
    c, s = math.cos(math.pi - angle), math.sin(math.pi - angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def lit(corners: Array, colour: Array) -> Array:
    """Each corner's colour (n, 3, 3) of triangles (n, 3, 3): Lambert's law for the whole triangle."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shade = AMBIENT + (1 - AMBIENT) * np.maximum(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0)
    return np.repeat((shade[:, None] * colour)[:, None], 3, axis=1)


def model_triangles(entry: ModelEntry) -> Array:
    """Rows (n, 8) of position, colour and texture of all copies of a model."""
    import trimesh

    assert not isinstance(entry.paint, Path)
    mesh = trimesh.load_mesh(entry.file, process=False, skip_materials=True)
    triangles = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    rows = []
    for instance in entry.instances:
        corners = triangles @ rotation(instance.angle).T + np.array(instance.position)
        tints = lit(corners, np.array(entry.paint))
        rows.append(np.concatenate([corners, tints, np.zeros((*corners.shape[:2], 2))], axis=2).reshape(-1, 8))
    return np.concatenate(rows)


def block_triangles(entry: BlockEntry, instance: Instance) -> Array:
    """Rows (36, 8) of position, colour and texture of a block."""
    size, rows = np.array(entry.dimension), []
    colour = np.zeros(3) if isinstance(entry.paint, Path) else np.array(entry.paint)
    for axis in range(3):
        first, second = (a for a in range(3) if a != axis)
        tile = entry.texture_size or (size[first], size[second])
        for sign in (-0.5, 0.5):
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)):
                corner = np.zeros(3)
                corner[axis], corner[first], corner[second] = sign, a - 0.5, b - 0.5
                place = rotation(instance.angle) @ (corner * size) + np.array(instance.position)
                rows.append([*place, *colour, a * size[first] / tile[0], b * size[second] / tile[1]])
    return np.array(rows)


class GlPeer:
    """Draws a map with OpenGL and reads the image back, which is upside down in OpenGL and so drawn that way."""

    def __init__(self, path: Path, width: int, height: int, fovy: float) -> None:
        """Size in pixels, vertical field of view in rad."""
        import moderngl

        self.gl: Any = moderngl.create_context(standalone=True, backend="egl")
        self._width, self._height = width, height
        self._program = self.gl.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        colour, depth = self.gl.renderbuffer((width, height), 4), self.gl.depth_renderbuffer((width, height))
        self._frame = self.gl.framebuffer([colour], depth)
        f = 1 / math.tan(fovy / 2)
        a, b = (FAR + NEAR) / (NEAR - FAR), 2 * FAR * NEAR / (NEAR - FAR)
        self._projection = np.array([[f * height / width, 0, 0, 0], [0, -f, 0, 0], [0, 0, a, b], [0, 0, -1, 0]])
        entries = read_map(path)
        self._parts = [self._plain(np.concatenate([self._ground(), *map(model_triangles, entries.models)]))]
        for block in entries.blocks:
            rows = np.concatenate([block_triangles(block, instance) for instance in block.instances])
            self._parts.append(
                self._textured(rows, block.paint) if isinstance(block.paint, Path) else self._plain(rows)
            )
        self._pixels = np.empty((height, width, 4), np.uint8)
        self.name = str(self.gl.info["GL_RENDERER"])

    def _ground(self) -> Array:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) * FAR / 2
        rest = [-0.5, *np.array(GROUND) / 255, 0.0, 0.0]
        return np.column_stack([corners, np.tile(rest, (6, 1))])

    def _plain(self, rows: Array) -> tuple[Any, Any]:
        buffer = self.gl.buffer(rows.astype(np.float32).tobytes())
        return self.gl.vertex_array(self._program, [(buffer, "3f 3f 2f", "place", "tint", "spot")]), None

    def _textured(self, rows: Array, file: Path) -> tuple[Any, Any]:
        picture = cv2.cvtColor(cv2.imread(str(file)), cv2.COLOR_BGR2RGB)
        texture = self.gl.texture((picture.shape[1], picture.shape[0]), 3, picture.tobytes(), alignment=1)
        texture.build_mipmaps()
        texture.filter = (self.gl.LINEAR_MIPMAP_LINEAR, self.gl.LINEAR)
        return self._plain(rows)[0], texture

    def render(self, position: Array, axes: Array) -> Image:
        """The image (height, width, 4) in the order B, G, R, A, the next one drawn over it.

        ``position`` (3,) in the world, ``axes`` (3, 3) of the camera as rows: right, down and forward.
        """
        view = np.eye(4)
        view[:3, :3] = axes * np.array([[1.0], [-1.0], [-1.0]])
        view[:3, 3] = -view[:3, :3] @ position
        self._frame.use()
        self.gl.enable(self.gl.DEPTH_TEST)
        self._frame.clear(*(part / 255 for part in SKY[::-1]), 1.0)
        self._program["camera"].write((self._projection @ view).T.astype(np.float32).tobytes())
        for vertices, texture in self._parts:
            self._program["textured"].value = texture is not None
            if texture is not None:
                texture.use()
            vertices.render()
        self._frame.read_into(self._pixels, components=4)
        return self._pixels


def grey(picture: Image) -> Array:
    return cv2.cvtColor(picture, cv2.COLOR_BGRA2GRAY).astype(np.float64)


def ssim(one: Image, other: Image) -> float:
    """Structural similarity of two images (Wang et al. 2004): grey, a Gaussian window of 1.5 pixels."""
    a, b = grey(one), grey(other)

    def mean(values: Array) -> Array:
        return np.asarray(cv2.GaussianBlur(values, (11, 11), 1.5), np.float64)

    ma, mb = mean(a), mean(b)
    va, vb, both = mean(a * a) - ma * ma, mean(b * b) - mb * mb, mean(a * b) - ma * mb
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    similar = (2 * ma * mb + c1) * (2 * both + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    return float(similar.mean())
