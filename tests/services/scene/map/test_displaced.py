import numpy as np
import pytest

from dodo_dsl import package_data
from services.scene.scene import SceneOptions, load_scene

STRAIGHT = package_data.registry() / "maps" / "straight"


def offsets(reach: float, seed: int = 3) -> np.ndarray:
    plain, moved = (load_scene(STRAIGHT, SceneOptions(displaced=r, seed=seed)) for r in (0.0, reach))
    return np.concatenate([b.positions - a.positions for a, b in zip(plain.models, moved.models, strict=True)])


def test_each_model_stands_at_its_own_place_within_reach_on_the_ground() -> None:
    moved = offsets(0.05)
    away = np.hypot(moved[:, 0], moved[:, 1])
    assert (away <= 0.05).all() and (away > 0).all() and len(np.unique(away)) == len(away)
    assert away.mean() == pytest.approx(0.05 * 2 / 3, rel=0.25), "the mean of points alike likely in a disc"
    assert abs(moved[:, :2].mean(axis=0)).max() < 0.02 and (moved[:, 2] == 0).all()


def test_clutter_stays_where_it_is() -> None:
    plain, moved = (load_scene(STRAIGHT, SceneOptions(clutter=20, displaced=r, seed=1)) for r in (0.0, 0.1))
    scenery = [[c.positions for c in scene.models if not c.name] for scene in (plain, moved)]
    assert scenery[0] and all((a == b).all() for a, b in zip(*scenery, strict=True))
