"""Tables, as the beacon's way points and targets are read from them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.assets.table import read_target
from dodo_dsl.opendlv.assets.trajectory import TrajectoryError, read_points, read_table

READERS: list[Callable[[Path], Any]] = [lambda path: read_table(path, 0.0), lambda path: read_target(path, "x")]


def table(folder: Path, text: str) -> Path:
    path = folder / "way.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_way_points_have_their_columns_in_any_order(tmp_path: Path) -> None:
    path = table(tmp_path, "\ufefftime, y,x,yaw,note\n# from the survey\n\n0,1,2,0.5,slowly\n1.5,-1e-1,.25,-3,\r\n")
    first, second = read_table(path, height=0.3)
    assert (first.x, first.y, first.z, first.yaw, first.time) == (2, 1, 0.3, 0.5, 0)
    assert (second.x, second.y, second.yaw, second.time) == (0.25, -0.1, -3, 1.5)
    assert second.place == f"{path}:5"
    (point, _) = read_table(table(tmp_path, "x,y,z\n1,2,3\n2,2,3\n"), height=9)
    assert (point.z, point.yaw, point.time) == (3, None, None)


@pytest.mark.parametrize(
    "text",
    [
        "time,x\n0,0.5\n1.25,-1e-1\n",
        "time,value\n0,0.5\n1.25,-0.1\n\n",
        "value, time ,x\n9,0,0.5\n9,1.25,-0.1\n",
        "\ufefftime,value\r\n0,0.5\r\n1.25,-0.1\r\n",
    ],
)
def test_targets(tmp_path: Path, text: str) -> None:
    assert read_target(table(tmp_path, text), "x") == [(0, 0.5), (1_250_000, -0.1)]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", ": the table is empty"),
        ("time,y,x\n", ":1:1: expected at least 2 rows below the header, found 0"),
        ("0,1,2\n1,1,2\n2,1,2\n", ":1:1: expected a header with"),
        ("time;x;y\n0;0;0\n1;1;1\n", ":1:1: semicolons between the columns"),
        ("tim,z,t\n0,1,2\n1,1,2\n", ":1:1: "),
        ("time,x,y,x\n0,0,0,0\n1,0,0,0\n", ":1:6: the column 'x' appears twice"),
        ("time,x,y\n0,1,1\n1,1\n", ":3:1: 2 values, expected 3: time, x, y"),
        ("time,x,y\n0,1,1\n1, two,1\n", ":3:3: x: 'two' is not a finite number"),
        ("time,x,y\n0,1,1\n1,1e999,1\n", ":3:3: x: '1e999' is not a finite number"),
        ("time,x,y\n0,,1\n1,1,1\n", ":2:3: x: '' is not a finite number"),
        ("time,x,y\n0,1,1\n-inf,1,1\n", ":3:1: time: '-inf' is not a finite number"),
        ("time,x,y\n0,1,1\n1e30,1,1\n", ":3:1: the time '1e30' is out of range"),
        ("x,y,time\n1,1,1\n1,1,1.0000001\n", ":3:5: the time '1.0000001' is not after 1 s"),
        ('time,x,y\n0,"1,2\n1,1,1\n', ":2:1: "),
    ],
)
@pytest.mark.parametrize("read", READERS)
def test_mistakes_have_their_place(read: Callable[[Path], Any], tmp_path: Path, text: str, sentence: str) -> None:
    path = table(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}{sentence}")


@pytest.mark.parametrize("read", READERS)
def test_files_that_are_no_tables(read: Callable[[Path], Any], tmp_path: Path) -> None:
    (tmp_path / "bytes.csv").write_bytes(b"x,y\n\xff\xfe")
    for name, said in (("bytes.csv", "not UTF-8 text"), ("absent.csv", "No such file"), (".", "Is a directory")):
        with pytest.raises(InputError, match=said):
            read(tmp_path / name)


@given(st.binary(max_size=200) | st.text("xyz,timeaw0123.-\n\"' ", max_size=60).map(str.encode))
@pytest.mark.parametrize("read", READERS)
def test_any_bytes_are_a_table_or_one_sentence(
    read: Callable[[Path], Any], tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(data)
    try:
        assert len(read(path)) > 1
    except InputError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error).replace("\\n", "")


def test_points_are_pairs() -> None:
    first, second = read_points(["0 1", " -2.5   3e1 "], height=0.1)
    assert (first.x, first.y, second.x, second.y, second.z) == (0, 1, -2.5, 30, 0.1)
    for text in ("1 2 3", "1 b"):
        with pytest.raises(TrajectoryError, match=f"the point '{text}': expected two finite numbers"):
            read_points([text], height=0)
