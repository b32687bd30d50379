import json
from pathlib import Path
from typing import Any

import pytest
import shapely

from dodo_dsl.opendlv.assets.track import load_obstacles, pick, pick_walls


def write(folder: Path, document: Any) -> Path:
    text = document if isinstance(document, str) else json.dumps(document)
    (folder / "map.json").write_text(text, encoding="utf-8")
    return folder


def test_lines_by_name_from_the_folder_or_the_file(tmp_path: Path) -> None:
    write(
        tmp_path,
        {
            "model": [],
            "obstacles": [
                {"name": "left", "lines": [[0, 0, 1, 0], [1, 0, 1, 2]]},
                {"name": "finish", "lines": [0, 3, 1, 3]},
                {"name": "left", "lines": [[5, 5, 6, 6]]},
            ],
        },
    )
    obstacles = load_obstacles(tmp_path)
    assert obstacles["left"].wkt == "MULTILINESTRING ((0 0, 1 0), (1 0, 1 2), (5 5, 6 6))"
    assert obstacles["finish"].wkt == "MULTILINESTRING ((0 3, 1 3))"
    assert load_obstacles(tmp_path / "map.json").keys() == obstacles.keys()


def test_walls_of_a_text_file(tmp_path: Path) -> None:
    file = tmp_path / "simulation-map.txt"
    file.write_text("-2.0,-2.0,-2.0,2.0;\r\n\n-2,0,0,0; 1,1,2,2;\n")
    obstacles = load_obstacles(file)
    assert {name: lines.wkt for name, lines in obstacles.items()} == {
        "obstacle-1": "MULTILINESTRING ((-2 -2, -2 2))",
        "obstacle-2": "MULTILINESTRING ((-2 0, 0 0))",
        "obstacle-3": "MULTILINESTRING ((1 1, 2 2))",
    }


@pytest.mark.parametrize("wrong", ["1,2,3;", "1,2,3,4,5;", "a,0,0,0;", "1,2,3,nan;", "1,2,3,1e9;", "\xff;"])
def test_what_is_no_wall(wrong: str, tmp_path: Path) -> None:
    file = tmp_path / "room.txt"
    file.write_text(f"0,0,1,1;\n{wrong}\n", encoding="latin-1")
    with pytest.raises(ValueError, match=r"room\.txt:2: expected a wall x1,y1,x2,y2; in m, found "):
        load_obstacles(file)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"obstacles": {}}, ": $.obstacles: expected a list, found {}"),
        ({"obstacles": [{"name": " ", "lines": [0, 0, 1, 1]}]}, ": $.obstacles[0].name: expected a text"),
        ({"obstacles": [{"lines": []}]}, ": $.obstacles[0].lines: expected a list of length >= 1"),
        ({"obstacles": [{"name": "a"}]}, ": $.obstacles[0]: 'lines' is missing"),
        ({"obstacles": [{"lines": [0, 0, "1", 1]}]}, ": $.obstacles[0].lines[0][2]: expected a number"),
    ],
)
def test_what_is_no_map_is_said_with_its_place(tmp_path: Path, document: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        load_obstacles(write(tmp_path, document))
    assert str(caught.value).startswith(f"{tmp_path / 'map.json'}{message}")


def test_unknown_names_are_said_with_what_there_is(tmp_path: Path) -> None:
    names = ("left", "right", "finish")
    write(tmp_path, {"obstacles": [{"name": name, "lines": [0, 0, 1, 1]} for name in names]})
    obstacles = load_obstacles(tmp_path)
    assert list(pick(obstacles, ["right", "left"], "walls", tmp_path)) == ["right", "left"]
    with pytest.raises(ValueError) as caught:
        pick(obstacles, ["left", "rigth"], "walls", tmp_path)
    assert str(caught.value) == f"--walls: the map {tmp_path} has no obstacle 'rigth'; did you mean 'right'?"
    with pytest.raises(ValueError) as caught:
        pick(obstacles, ["xyz"], "goal", tmp_path)
    assert str(caught.value) == f"--goal: the map {tmp_path} has no obstacle 'xyz'; it has finish, left, right"
    with pytest.raises(ValueError, match="has no obstacle 'xyz'; it has none"):
        pick({}, ["xyz"], "goal", tmp_path)


BLOCKS = [
    {"name": "floor", "dimension": [10, 10, 0.2], "color": [0, 0, 0], "instances": [[0, 0, -0.1, 0]]},
    {"name": "ceiling", "dimension": [10, 10, 0.2], "color": [0, 0, 0], "instances": [[0, 0, 1.9, 0]]},
    {"name": "wall", "dimension": [0.6, 0.02, 0.3], "color": [0, 0, 0], "instances": [[1, 0, 0, 1.5707963267948966]]},
    {"name": "gantry", "dimension": [0.6, 0.1, 0.1], "color": [0, 0, 0], "instances": [[2, 0, 0.25, 0]]},
]


def test_blocks_at_the_height_of_the_vehicle_are_walls(tmp_path: Path) -> None:
    write(tmp_path, {"obstacles": [{"name": "left", "lines": [0, 0, 1, 1]}], "block": BLOCKS})
    obstacles = load_obstacles(tmp_path)
    walls = pick_walls(obstacles, ["left", "blocks"], (), tmp_path, 0.15)
    assert list(walls) == ["left", "wall"]
    assert walls["wall"].bounds == pytest.approx((0.99, -0.3, 1.01, 0.3))
    assert walls["wall"].distance(shapely.Point(0.5, 0.1)) == pytest.approx(0.49)
    assert list(pick_walls(obstacles, ["blocks"], (), tmp_path, 0.25)) == ["wall", "gantry"]
    assert list(pick_walls(obstacles, ["wall"], (), tmp_path, 0.15)) == ["wall"]


def test_no_block_at_the_height_of_the_vehicle_is_said(tmp_path: Path) -> None:
    write(tmp_path, {"block": BLOCKS[:2]})
    within = "block between 0.01 and 0.15 m above the ground in the map"
    for name in ("blocks", "floor"):
        with pytest.raises(ValueError, match=f"^--walls: '{name}' names no {within}"):
            pick_walls({}, [name], (), tmp_path, 0.15)
    with pytest.raises(ValueError, match=r"^--walls: '\*' names no obstacle in the map"):
        pick_walls({}, ["*"], (), tmp_path, 0.15)
    with pytest.raises(ValueError, match="has no obstacle 'hedge'"):
        pick_walls({}, ["hedge"], (), tmp_path, 0.15)
