import numpy as np
import pytest

from benchmarks.pictures.gl_peer import ssim
from dodo_dsl import package_data
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import SceneOptions, load_scene

AT = CameraPose.at(0.3, 2, 0.095, yaw=1.9)


@pytest.fixture(scope="module")
def renderer():
    """The shipped curve with cones, and things around it of which some stand in one another."""
    return Renderer(
        load_scene(package_data.registry() / "maps" / "left-curve", SceneOptions(clutter=60)), 640, 480, 0.85
    )


@pytest.mark.parametrize(
    "other",
    [
        CameraPose.at(0.302, 2.005, 0.095, yaw=1.9),
        CameraPose.at(0.3, 2, 0.095, yaw=1.91),
        CameraPose.at(0.3, 2, 0.097, pitch=0.005, yaw=1.895),
    ],
    ids=["driven on", "turned", "nodding"],
)
def test_from_close_by_it_looks_as_drawn_anew(renderer, other):
    out = np.empty((480, 640, 4), np.uint8)
    first, moved = (picture.copy() for picture in renderer.render_around(AT, [other], out))
    assert np.array_equal(first, renderer.render(AT))
    anew = renderer.render(other)
    assert ssim(moved, anew) > 0.98 > ssim(first, anew)
