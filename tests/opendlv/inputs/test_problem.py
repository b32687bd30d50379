from pathlib import Path

import pytest

from dodo_dsl.opendlv.assets.problem import InputError, json_position

TEXT = """{"a": {"b": 1, "b": [10,
   {"c": "]}"}, 30] },
 "d": [[], {}]}
"""


@pytest.mark.parametrize(
    ("where", "position"),
    [
        ("$", (1, 1)),
        ("$.a", (1, 7)),
        ("$.a.b", (1, 21)),
        ("a.b[0]", (1, 22)),
        ("a.b[1].c", (2, 10)),
        ("a.b[2]", (2, 17)),
        ("a.b[3]", (1, 21)),
        ("a.b[1].missing", (2, 4)),
        ("d[1]", (3, 12)),
        ("d[0].x", (3, 8)),
        ("none", (1, 1)),
    ],
)
def test_places_in_json(where: str, position: tuple[int, int]) -> None:
    assert json_position(TEXT, where) == position


def test_a_problem_has_its_place_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "map.json"
    file.write_text(TEXT)
    assert InputError(file, "wrong", "d[1]").position() == (3, 12)
    assert InputError(file, "wrong", line=2, column=3).position() == (2, 3)
    assert InputError(file, "wrong").position() == InputError(tmp_path / "gone", "wrong", "d").position() == (1, 1)
