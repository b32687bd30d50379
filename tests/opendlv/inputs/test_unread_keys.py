"""A key that nothing reads is told at every level of the files that tests name."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.assets import formats
from dodo_dsl.opendlv.assets.problem import InputError

MAP: dict[str, Any] = {
    "model": [{"name": "cone", "file": "cone.obj", "color": [1, 0, 0], "instances": [[0, 1, 0, 0]]}],
    "block": [{"name": "floor", "dimension": [9, 9, 1], "color": [0, 0, 0], "instances": [[0, 0, -0.5, 0]]}],
    "overlay": [],
    "obstacles": [{"name": "finish", "lines": [[-1, 3, 1, 3]]}],
}
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def told(tmp_path: Path) -> Callable[[str, Any], list[InputError]]:
    """What is said about a document of a format."""
    (tmp_path / "cone.obj").write_text(OBJ)

    def problems(name: str, document: Any) -> list[InputError]:
        (tmp_path / "map.json").write_text(json.dumps(document, indent=1))
        return list(formats.problems(name, tmp_path / "map.json", {}, {}))

    return problems


def objects(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The paths of all objects of a document."""
    if isinstance(value, dict):
        yield path
    for step, below in (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    ):
        yield from objects(below, (*path, step))


CASES = [(name, path) for name in ("map", "obstacles") for path in objects(MAP)]


@pytest.mark.parametrize(("name", "path"), CASES, ids=str)
def test_an_unknown_key_is_told_where_it_is(
    told: Callable[[str, Any], list[InputError]], name: str, path: tuple[str | int, ...]
) -> None:
    document = json.loads(json.dumps(MAP))
    inner = document
    for step in path:
        inner = inner[step]
    inner["zzq"] = 1
    line = next(n for n, each in enumerate(json.dumps(document, indent=1).splitlines(), 1) if "zzq" in each)
    assert [(e.is_slip, e.position()[0]) for e in told(name, document) if "'zzq'" in e.what] == [(True, line)]


def test_a_key_of_many_objects_is_told_once(told: Callable[[str, Any], list[InputError]]) -> None:
    (found,) = told("map", {**MAP, "obstacles": [{**MAP["obstacles"][0], "lnes": 1, "name": name} for name in "abc"]})
    assert found.what == "$.obstacles[0].lnes: nothing reads 'lnes'"
    assert found.hint == "did you mean 'lines'?"


def test_bodies_that_a_map_does_not_have_are_told(tmp_path: Path) -> None:
    (tmp_path / "map.json").write_text(json.dumps({"model": [{"frames": [0]}], "obstacles": []}))
    given = {"bodies": "true", "frame-id": "0"}
    (found,) = formats.problems("obstacles", tmp_path, given, {})
    assert found.what == "no model of the map has 'frames' of other sender stamps than the vehicle's"
    assert list(formats.problems("obstacles", tmp_path, {**given, "frame-id": "1"}, {})) == []
    assert list(formats.problems("obstacles", tmp_path, {**given, "bodies": ""}, {})) == []
