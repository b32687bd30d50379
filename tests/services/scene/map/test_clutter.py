import numpy as np

from dodo_dsl import package_data
from services.scene.scene import FARTHEST, NEAREST, clutter, load_scene

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
