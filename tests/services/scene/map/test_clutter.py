import numpy as np
import pytest

from dodo_dsl import package_data
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import FARTHEST, NEAREST, SceneOptions, clutter, load_scene

STRAIGHT = package_data.registry() / "maps" / "straight"


def test_clutter_stands_around_the_models_and_has_no_name():
    around = load_scene(STRAIGHT).models
    boxes = clutter(60, 5, around)
    places = np.concatenate([copies.positions for copies in boxes])
    models = np.concatenate([copies.positions for copies in around])[:, :2]
    off = np.maximum(models.min(axis=0) - places[:, :2], places[:, :2] - models.max(axis=0)).max(axis=1)
    assert len(places) == 60
    assert off.min() >= NEAREST - 1e-9
    assert off.max() <= FARTHEST + 1e-9
    assert {copies.name for copies in boxes} == {""}


@pytest.mark.thorough
def test_the_seed_alone_decides_the_clutter():
    def drawn(seed):
        renderer = Renderer(load_scene(STRAIGHT, SceneOptions(clutter=30, seed=seed)), 160, 120, 1.0)
        return renderer.render(CameraPose.at(0, 0, 0.1, yaw=1.57))

    assert np.array_equal(drawn(3), drawn(3))
    assert not np.array_equal(drawn(3), drawn(4))
