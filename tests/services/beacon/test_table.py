from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.trajectory import Trajectory, TrajectoryError, read_points, read_table
from tests.services.process import ROOT


def table(folder: Path, text: str) -> Path:
    path = folder / "way.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_come_in_any_order(tmp_path: Path) -> None:
    path = table(tmp_path, "\ufefftime, y,x,yaw\n# from the survey\n\n0,1,2,0.5\n1.5,-1e-1,.25,-3\r\n")
    first, second = read_table(path, height=0.3)
    assert (first.x, first.y, first.z, first.yaw, first.time) == (2, 1, 0.3, 0.5, 0)
    assert (second.x, second.y, second.yaw, second.time) == (0.25, -0.1, -3, 1.5)
    assert second.place == f"{path}:5"


def test_a_column_z_counts_more_than_the_height(tmp_path: Path) -> None:
    (point,) = read_table(table(tmp_path, "x,y,z\n1,2,3\n"), height=9)
    assert (point.z, point.yaw, point.time) == (3, None, None)


def test_columns_for_others_are_left_to_them(tmp_path: Path) -> None:
    (point,) = read_table(table(tmp_path, "x,y,groundSteering,note\n1,2,0.1,slowly\n"), height=0)
    assert (point.x, point.y) == (1, 2)


def test_the_tables_of_the_registry_are_ways() -> None:
    paths = sorted((ROOT / "tests_registry" / "targets").glob("*.csv"))
    assert paths
    for path in paths:
        assert Trajectory(read_table(path, height=0), speed=1).duration > 1


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", " is empty, expected a header with the columns x and y"),
        ("x,z\n", ":1: the column 'y' is missing"),
        ("x,y,times\n", ":1: unknown column 'times', did you mean 'time'?"),
        ("x;y\n0;0\n", ":1: the column 'x' is missing"),
        ("X,y\n", ":1: unknown column 'X', did you mean 'x'?"),
        ("x,y,x\n", ":1: the column 'x' appears twice"),
        ("x,y\n1,2\n1,2,3\n", ":3: 3 values, expected 2: x, y"),
        ("x,y\n\n1,two\n", ":3: y: 'two' is not a finite number"),
        ("x,y\n1,nan\n", ":2: y: 'nan' is not a finite number"),
        ("x,y\n1,\n", ":2: y: '' is not a finite number"),
        ('x,y\n"1,2\n', ":2: "),
    ],
)
def test_mistakes_are_named_with_file_and_line(tmp_path: Path, text: str, sentence: str) -> None:
    path = table(tmp_path, text)
    with pytest.raises(TrajectoryError) as caught:
        read_table(path, height=0)
    assert str(caught.value).startswith(f"{path}{sentence}")


def test_a_missing_file_and_one_of_bytes(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match=r"no\.csv cannot be read: No such file"):
        read_table(tmp_path / "no.csv", height=0)
    (tmp_path / "way.csv").write_bytes(b"x,y\n\xff\xfe")
    with pytest.raises(TrajectoryError, match="is not UTF-8 text"):
        read_table(tmp_path / "way.csv", height=0)


@given(st.binary(max_size=200) | st.text("xyz,timeaw0123.-\n\"' ", max_size=60).map(str.encode))
def test_any_bytes_are_a_table_or_one_sentence(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(data)
    try:
        found = read_table(path, height=0)
    except TrajectoryError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error).replace("\\n", "")
    else:
        assert all(isinstance(point.x, float) for point in found)


def test_points_are_pairs() -> None:
    first, second = read_points(["0 1", " -2.5   3e1 "], height=0.1)
    assert (first.x, first.y, second.x, second.y, second.z) == (0, 1, -2.5, 30, 0.1)
    with pytest.raises(TrajectoryError, match="the point '1 2 3' has 3 numbers"):
        read_points(["1 2 3"], height=0)
    with pytest.raises(TrajectoryError, match="the point '1 b': 'b' is not a finite number"):
        read_points(["1 b"], height=0)
