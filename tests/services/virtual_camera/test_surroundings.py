"""Overlays, tape and clutter."""

import numpy as np
import pytest

from dodo_dsl import package_data
from services.virtual_camera.camera import Pose
from services.virtual_camera.draw.lines import TAPE
from services.virtual_camera.draw.render import Renderer
from services.virtual_camera.draw.scene import Wishes, load_scene
from services.virtual_camera.image.overlays import Overlay, load_overlays
from services.virtual_camera.map.clutter import FARTHEST, NEAREST, clutter
from services.virtual_camera.map.json_node import MapError

STRAIGHT = package_data.registry() / "maps" / "straight"


def test_tape_is_where_the_pinhole_puts_the_line(write_map):
    lines = [{"name": "left", "lines": [[1, 0.3, 9, 0.3]]}, {"name": "other", "lines": [[2, -1, 2, 1]]}]
    floor = {"name": "f", "dimension": [40, 40, 1], "color": [0, 0, 0], "instances": [[0, 0, -0.5, 0]]}
    folder = write_map({"obstacles": lines, "block": [floor]})
    renderer = Renderer(load_scene(folder, Wishes(lines=("left",), line_width=0.1)), 640, 480, 1.0)
    image = renderer.render(Pose.at(0, 0, 0.5))
    for row in (300, 340, 390):
        depth = 0.5 * renderer.camera.focal / (row + 0.5 - 240)
        middle, half = 320 - renderer.camera.focal * 0.3 / depth, renderer.camera.focal * 0.05 / depth
        tape = np.flatnonzero((image[row] == TAPE).all(axis=-1))
        assert (tape.min(), tape.max() + 1) == pytest.approx((middle - half, middle + half), abs=1.2)
    assert not (image[300, 400:] == TAPE).all(axis=-1).any()


def test_an_unknown_line_is_told_with_those_that_there_are():
    with pytest.raises(MapError, match=r"no obstacle 'middle' with lines; the map has finish, left, right"):
        load_scene(STRAIGHT, Wishes(lines=("middle",)))


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
        (overlay(size=(1.5, 1)), r"overlay\[0\].dimension: expected the numbers \[width, height\], fractions"),
        (overlay(place=(1, 2, 3)), r"overlay\[0\].instances\[0\]: expected the numbers \[x, y\]"),
        (overlay("none.png"), r"overlay\[0\].textureFile: expected a file"),
    ):
        with pytest.raises(MapError, match=message):
            load_scene(write_map({"overlay": [entry]}))


def test_an_overlay_of_a_broken_picture_is_told(write_map):
    folder = write_map({"overlay": [overlay()]}, {"t.png": "no picture"})
    with pytest.raises(MapError, match=r"t\.png: this is not a picture"):
        laid(folder)


def test_an_opaque_overlay_replaces_what_is_there():
    picture = np.full((3, 3, 4), 50, np.uint8)
    Overlay(np.full((1, 1, 4), (1, 2, 3, 255), np.uint8), 1, 1, (3, 3)).lay(picture)
    assert picture[1, 1].tolist() == [1, 2, 3, 50]
    assert (picture == 50).sum() == 33


def test_clutter_stands_around_the_models_and_has_no_name():
    around = load_scene(STRAIGHT).crowds
    boxes = clutter(60, 5, around)
    places = np.concatenate([crowd.positions for crowd in boxes])
    models = np.concatenate([crowd.positions for crowd in around])[:, :2]
    off = np.maximum(models.min(axis=0) - places[:, :2], places[:, :2] - models.max(axis=0)).max(axis=1)
    assert len(places) == 60
    assert off.min() >= NEAREST - 1e-9
    assert off.max() <= FARTHEST + 1e-9
    assert {crowd.name for crowd in boxes} == {""}


def test_the_seed_alone_decides_the_clutter():
    def drawn(seed):
        renderer = Renderer(load_scene(STRAIGHT, Wishes(clutter=30, seed=seed)), 160, 120, 1.0)
        return renderer.render(Pose.at(0, 0, 0.1, yaw=1.57))

    assert np.array_equal(drawn(3), drawn(3))
    assert not np.array_equal(drawn(3), drawn(4))


def test_clutter_of_a_map_without_models_surrounds_the_origin():
    places = np.concatenate([crowd.positions for crowd in clutter(20, 1, ())])
    assert np.abs(places).max() <= FARTHEST
