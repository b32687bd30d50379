import numpy as np
import pytest

from dodo_dsl.opendlv.assets.problem import InputError
from services.scene.scene import load_scene
from services.virtual_camera.optics import load_overlays


def overlay(name="t.png", size=(0.5, 0.25), place=(0.25, 0.5)):
    return {"name": "o", "dimension": list(size), "textureFile": name, "instances": [list(place)]}


def laid(folder, width=80, height=60):
    picture = np.full((height, width, 4), (100, 100, 100, 255), np.uint8)
    for each in load_overlays(load_scene(folder).overlays, width, height):
        each.lay(picture)
    return picture


def test_an_overlay_covers_its_part_of_the_picture(write_map):
    picture = laid(write_map({"overlay": [overlay()]}, pictures={"t.png": np.full((4, 4, 3), 9, np.uint8)}))
    inside = (picture[..., 0] == 9).nonzero()
    assert [(v.min(), v.max() + 1) for v in inside] == [(30, 45), (20, 60)]
    assert (picture[..., 3] == 255).all()
    assert len(inside[0]) == 15 * 40


def test_an_overlay_is_as_opaque_as_its_alpha(write_map):
    half = np.full((4, 4, 4), (200, 0, 200, 128), np.uint8)
    picture = laid(write_map({"overlay": [overlay()]}, pictures={"t.png": half}))
    assert picture[35, 40].tolist() == pytest.approx([150, 50, 150, 255], abs=1)
    assert picture[5, 5].tolist() == [100, 100, 100, 255]


@pytest.mark.parametrize("place", [(-0.3, -0.2), (0.9, 0.9), (3.0, 0.0), (-2.0, 5.0)])
def test_an_overlay_may_leave_the_picture(write_map, place):
    folder = write_map({"overlay": [overlay(place=place)]}, pictures={"t.png": np.zeros((4, 4, 3), np.uint8)})
    spans = zip(place, (80, 60), (40, 15), strict=True)
    columns, rows = ([max(0, round(at * n)), min(n, round(at * n) + size)] for at, n, size in spans)
    seen = max(0, columns[1] - columns[0]) * max(0, rows[1] - rows[0])
    assert (laid(folder)[..., 0] == 0).sum() == seen


def test_overlays_that_make_no_sense_are_told(write_map):
    for entry, message in (
        (overlay(size=(1.5, 1)), r"overlay\[0\].dimension\[0\]: expected a number <= 1.0"),
        ({**overlay(), "instances": [[1]]}, r"overlay\[0\].instances\[0\]: expected a list of length"),
        (overlay("none.png"), r"overlay\[0\].textureFile: expected a regular file"),
    ):
        with pytest.raises(InputError, match=message):
            load_scene(write_map({"overlay": [entry]}, pictures={"t.png": np.zeros((4, 4, 3), np.uint8)}))
