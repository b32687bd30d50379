import json
import os
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.map_file import MAX_BLOCKS, read_map, read_obstacles
from dodo_dsl.opendlv.assets.problem import InputError

GOOD_MODEL = {"name": "cube", "file": "cube.obj", "color": [1, 0, 0.5], "instances": [[1, 2, 3, 0.5]]}
GOOD_BLOCK = {"name": "floor", "dimension": [10, 10, 0.2], "color": [0, 0, 0], "instances": [[0, 0, 0, 0]]}


def changed(entry, **changes):
    return {key: value for key, value in {**entry, **changes}.items() if value is not ...}


def test_a_map_is_read_from_its_folder_or_its_file(write_map):
    folder = write_map({"model": [GOOD_MODEL], "block": [GOOD_BLOCK], "obstacles": "not ours", "overlay": []})
    for path in (folder, folder / "map.json"):
        read = read_map(path)
        (model,), (block,) = read.models, read.blocks
        assert (model.name, model.file, model.paint) == ("cube", (folder / "cube.obj").resolve(), (1.0, 0.0, 0.5))
        assert (model.instances[0].position, model.instances[0].angle) == ((1.0, 2.0, 3.0), 0.5)
        assert (block.dimension, block.texture_size) == ((10.0, 10.0, 0.2), None)


def test_a_model_stands_at_frames_and_instances(write_map):
    """As OpenDLV has it: both count, and of two models at one frame the last."""
    car = changed(GOOD_MODEL, name="car", instances=..., frames=[1, 4294967295])
    other = changed(GOOD_MODEL, name="other", frames=[2, 1])
    found = read_map(write_map({"model": [GOOD_MODEL, car, other]})).models
    assert [(m.name, len(m.instances), m.frames) for m in found] == [
        ("cube", 1, ()), ("car", 0, (4294967295,)), ("other", 1, (2, 1)),
    ]  # fmt: skip
    assert [m.name for m in read_map(write_map({"model": [changed(car, frames=[1]), other]})).models] == ["other"]


def test_a_real_map_is_read(shared_data, tmp_path):
    content = json.loads(shared_data("map.json").read_text())
    (tmp_path / "map.json").write_text(json.dumps(content))
    for name in ("cone.obj", "kiwi.obj", "kiwi.png", "floor.jpg", "ceiling.jpg", "wall.jpg"):
        (tmp_path / name).touch()
    read = read_map(tmp_path)
    assert [(len(m.instances), m.frames) for m in read.models] == [(46, ()), (42, ()), (2, ()), (0, (0, 1))]
    assert [(b.name, b.texture_size, len(b.instances)) for b in read.blocks] == [
        ("floor", (1.0, 1.0), 1),
        ("ceiling", (1.0, 1.0), 1),
        ("wall", (1.0, 1.0), 4),
    ]


BAD_MODELS = [
    ({"instances": [[1, 2, 3]]}, "$.model[0].instances[0]: expected a list of length 4, found [1, 2, 3]"),
    ({"instances": [[1, 2, 3, "a"]]}, '$.model[0].instances[0][3]: expected a number, found "a"'),
    ({"instances": [[1, 2e9, 3, 0]]}, "$.model[0].instances[0][1]: expected a number <= 100000.0, found 2000000000.0"),
    ({"color": [1, 2, 3]}, "$.model[0].color[1]: expected a number <= 1.0, found 2"),
    ({"color": ...}, "$.model[0]: 'color' or 'textureFile' is missing"),
    ({"file": 3}, "$.model[0].file: expected a regular file in the map's folder, found 3"),
    ({"file": "cone.obj"}, "$.model[0].file: expected a regular file in the map's folder"),
    ({"file": "../cube.obj"}, "$.model[0].file: expected a file inside the map's folder"),
    ({"file": "/etc/passwd"}, "$.model[0].file: expected a file inside the map's folder"),
    ({"file": "a\0b"}, "$.model[0].file: expected "),
    ({"frames": [1.0]}, "$.model[0].frames[0]: expected a whole number, found 1.0"),
    ({"frames": [2**32]}, "$.model[0].frames[0]: expected a whole number"),
    ({"frames": [3, 3]}, "$.model[0]: a sender stamp appears twice among its frames"),
]


@pytest.mark.parametrize(("change", "message"), BAD_MODELS)
def test_a_bad_model_is_told_with_its_place(write_map, change, message):
    folder = write_map({"model": [changed(GOOD_MODEL, **change)]})
    with pytest.raises(InputError, match=re.escape(f"{folder / 'map.json'}: {message}")):
        read_map(folder)


BAD_BLOCKS = [
    ({"dimension": [1, 0, 1]}, "$.block[0].dimension[1]: expected a number > 0.0, found 0"),
    ({"textureSize": [1]}, "$.block[0].textureSize: expected a list of length 2, found [1]"),
    ({"color": ...}, "$.block[0]: 'color' or 'textureFile' is missing"),
    ({"instances": [[0, 0, 0, 0]] * (MAX_BLOCKS + 1)}, "501 instances of blocks, expected at most 500"),
]


@pytest.mark.parametrize(("change", "message"), BAD_BLOCKS)
def test_a_bad_block_is_told_with_its_place(write_map, change, message):
    folder = write_map({"block": [changed(GOOD_BLOCK, **change)]})
    with pytest.raises(InputError, match=re.escape(message)):
        read_map(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"map\.json:1:2: not JSON: input data was truncated"),
        ("[]", r"map\.json: \$: expected an object, found \[\]"),
        ('{"model": 1}', r"\$\.model: expected a list, found 1"),
        ('{"model": [null]}', r"\$\.model\[0\]: expected an object, found null"),
        ('{"model": [{"instances": [[NaN, 0, 0, 0]]}]}', r"map\.json:1:28: not JSON: invalid character"),
        ("[" * 100_000, "nested too deeply"),
    ],
)
def test_what_is_no_map_is_told(write_map, text, message):
    with pytest.raises(InputError, match=message):
        read_map(write_map(text))


def test_absent_odd_and_huge_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"map\.json: cannot be read: No such file"):
        read_map(tmp_path)
    os.mkfifo(tmp_path / "map.json")
    with pytest.raises(InputError, match="a FIFO, expected a file"):
        read_map(tmp_path)
    (tmp_path / "huge.json").touch()
    os.truncate(tmp_path / "huge.json", regular_file.MOST_BYTES + 1)
    with pytest.raises(InputError, match="larger than 67108864 bytes"):
        read_map(tmp_path / "huge.json")
    (tmp_path / "latin.json").write_bytes(b'{"name": "\xe5"}')
    with pytest.raises(InputError, match="byte 10 is not UTF-8"):
        read_map(tmp_path / "latin.json")


def test_a_link_that_leads_out_of_the_folder_is_refused(write_map):
    folder = write_map({"model": [changed(GOOD_MODEL, file="link.obj")]})
    (folder / "link.obj").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match="inside the map's folder"):
        read_map(folder)


values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text("ab./\0é", max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*GOOD_BLOCK, "file"]), inner),
    max_leaves=12,
)


@settings(deadline=None)
@given(st.dictionaries(st.sampled_from(["model", "block"]), st.lists(values, max_size=2)))
@pytest.mark.thorough
def test_whatever_stands_in_a_map_is_read_or_refused(tmp_path_factory, content):
    folder = tmp_path_factory.getbasetemp() / "any"
    folder.mkdir(exist_ok=True)
    (folder / "map.json").write_text(json.dumps(content))
    try:
        read_map(folder)
    except InputError as error:
        assert str(folder / "map.json") in str(error)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("out", "expected a file inside the map's folder, and no symbolic link out of it, found"),
        ("fifo", "expected a regular file in the map's folder, found"),
        ("folder", "expected a regular file in the map's folder, found"),
    ],
)
def test_what_is_no_file_of_the_map_is_called_so(write_map, name, message):
    folder = write_map({"model": [changed(GOOD_MODEL, textureFile=name)]})
    (folder / "out").symlink_to("/etc/passwd")
    os.mkfifo(folder / "fifo")
    (folder / "folder").mkdir()
    with pytest.raises(InputError) as raised:
        read_map(folder)
    assert str(raised.value).endswith(f'$.model[0].textureFile: {message} "{name}"')
    assert "did you mean" not in raised.value.hint


def test_one_line_of_an_obstacle_needs_no_list(write_map):
    folder = write_map({"obstacles": [{"lines": [0, 1, 2, 3]}, {"lines": [[0, 1, 2, 3]], "name": "a"}]})
    assert read_obstacles(folder) == {"obstacle-1": [((0, 1), (2, 3))], "a": [((0, 1), (2, 3))]}
