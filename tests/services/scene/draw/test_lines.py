import numpy as np
import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.assets.problem import InputError
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import TAPE, SceneOptions, load_scene

STRAIGHT = package_data.registry() / "maps" / "straight"


def test_tape_is_where_the_pinhole_puts_the_line(write_map):
    lines = [{"name": "left", "lines": [[1, 0.3, 9, 0.3]]}, {"name": "other", "lines": [[2, -1, 2, 1]]}]
    floor = {"name": "f", "dimension": [40, 40, 1], "color": [0, 0, 0], "instances": [[0, 0, -0.5, 0]]}
    folder = write_map({"obstacles": lines, "block": [floor]})
    renderer = Renderer(load_scene(folder, SceneOptions(lines=("left",), line_width=0.1)), 640, 480, 1.0)
    image = renderer.render(CameraPose.at(0, 0, 0.5))
    for row in (300, 340, 390):
        depth = 0.5 * renderer.camera.focal / (row + 0.5 - 240)
        middle, half = 320 - renderer.camera.focal * 0.3 / depth, renderer.camera.focal * 0.05 / depth
        tape = np.flatnonzero((image[row] == TAPE).all(axis=-1))
        assert (tape.min(), tape.max() + 1) == pytest.approx((middle - half, middle + half), abs=1.2)
    assert not (image[300, 400:] == TAPE).all(axis=-1).any()


def test_an_unknown_line_is_told_with_those_that_there_are():
    with pytest.raises(InputError, match=r"no obstacle 'middle' with lines; .* behind, beyond, finish"):
        load_scene(STRAIGHT, SceneOptions(lines=("middle",)))
