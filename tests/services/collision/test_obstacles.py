import json
from pathlib import Path
from typing import Any

import pytest

from services.collision.track import ObstaclesError, load_obstacles, pick


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


def test_a_map_may_have_none(tmp_path: Path) -> None:
    assert load_obstacles(write(tmp_path, {"model": []})) == {}


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ([], ": $: expected an object, found []"),
        ({"obstacles": {}}, ": $.obstacles: expected a list, found {}"),
        ({"obstacles": ["left"]}, ": $.obstacles[0]: expected an object with a name"),
        ({"obstacles": [{"lines": []}]}, ": $.obstacles[0]: expected an object with a name"),
        (
            {"obstacles": [{"name": "a", "lines": []}]},
            ": $.obstacles[0].lines: expected a list of lines [x1, y1, x2, y2]",
        ),
        (
            {"obstacles": [{"name": "a", "lines": [[0, 0, 1, 1], [0, 0, 1]]}]},
            ": $.obstacles[0].lines[1]: expected four numbers [x1, y1, x2, y2] in metres",
        ),
        (
            {"obstacles": [{"name": "a", "lines": [0, 0, "1", 1]}]},
            ": $.obstacles[0].lines: expected four numbers [x1, y1, x2, y2] in metres",
        ),
        (
            '{"obstacles": [{"name": "a", "lines": [[0, 0, NaN, 1]]}]}',
            ": $.obstacles[0].lines[0]: expected four numbers [x1, y1, x2, y2] in metres",
        ),
        (
            "[",
            ":1:1: '[' is not closed",
        ),
    ],
)
def test_what_is_no_map_is_said_with_its_place(tmp_path: Path, document: Any, message: str) -> None:
    with pytest.raises(ObstaclesError) as caught:
        load_obstacles(write(tmp_path, document))
    assert str(caught.value) == f"{tmp_path / 'map.json'}{message}"


def test_a_missing_map(tmp_path: Path) -> None:
    with pytest.raises(ObstaclesError) as caught:
        load_obstacles(tmp_path / "nowhere")
    assert str(caught.value) == f"there is no file '{tmp_path / 'nowhere' / 'map.json'}'"


def test_unknown_names_are_said_with_what_there_is(tmp_path: Path) -> None:
    names = ("left", "right", "finish")
    write(tmp_path, {"obstacles": [{"name": name, "lines": [0, 0, 1, 1]} for name in names]})
    obstacles = load_obstacles(tmp_path)
    assert list(pick(obstacles, ["right", "left"], "walls", tmp_path)) == ["right", "left"]
    with pytest.raises(ObstaclesError) as caught:
        pick(obstacles, ["left", "rigth"], "walls", tmp_path)
    assert str(caught.value) == f"--walls: the map {tmp_path} has no obstacle 'rigth'; did you mean 'right'?"
    with pytest.raises(ObstaclesError) as caught:
        pick(obstacles, ["xyz"], "goal", tmp_path)
    assert str(caught.value) == f"--goal: the map {tmp_path} has no obstacle 'xyz'; it has finish, left, right"
    with pytest.raises(ObstaclesError, match="has no obstacle 'xyz'; it has none"):
        pick({}, ["xyz"], "goal", tmp_path)
