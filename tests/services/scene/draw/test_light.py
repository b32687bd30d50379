import numpy as np
import pytest

from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import SceneOptions, load_scene
from services.scene.shading import Light


def draw(folder, light, *pose, **angles):
    return Renderer(load_scene(folder, SceneOptions(light)), 64, 48, 1.0).render(CameraPose.at(*pose, **angles))


def test_the_side_towards_the_light_is_bright_and_the_other_has_the_ambient_share(cube_at):
    """A red cube seen along x: its front faces -x."""
    folder = cube_at([3, 0, 0, 0])
    for azimuth, expected in ((180, 255), (0, 0.2 * 255), (120, (0.2 + 0.8 * 0.5) * 255)):
        image = draw(folder, Light.of_flags(azimuth, 0, 0.2), 0, 0, 0.5)
        assert image[24, 32, 2] == pytest.approx(expected, abs=1)


def test_blocks_have_their_own_colour_until_a_light_is_asked_for(cube_at):
    folder = cube_at([50, 0, 0, 0])
    assert (draw(folder, Light.usual(), 0, 0, 1, pitch=1.0)[24, 32, :3] == 255).all()
    image = draw(folder, Light.of_flags(0, 30, 0.4), 0, 0, 1, pitch=1.0)
    assert image[24, 32, :3] == pytest.approx((0.4 + 0.6 * 0.5) * 255, abs=1)


def test_textures_are_shaded_as_colours_are(write_map):
    grey = np.full((8, 8, 3), 200, np.uint8)
    floor = {"name": "f", "dimension": [90, 90, 1], "textureFile": "t.png", "instances": [[0, 0, -0.5, 0]]}
    folder = write_map({"block": [floor]}, pictures={"t.png": grey})
    for pose, angles in (((0, 0, 1), {"pitch": 1.0}), ((42, 0, 1), {})):  # all of the picture, and a part of it
        image = draw(folder, Light.of_flags(0, 30, 0.4), *pose, **angles)
        assert image[46, 32].tolist() == pytest.approx([140, 140, 140, 255], abs=1)
