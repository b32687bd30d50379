import json
from pathlib import Path

import pytest
from msgspec.structs import asdict

from dodo_dsl.opendlv.assets.car import KIWI, Car, read_car
from dodo_dsl.opendlv.assets.problem import InputError


def written(folder: Path, text: str, name: str = "car.yml") -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_yaml_and_json_say_the_same(tmp_path: Path) -> None:
    values = {name.replace("_", "-"): value * 1.5 for name, value in asdict(KIWI).items()}
    as_yaml = "# a heavier car\n" + "".join(f"{key}: {value!r}\n" for key, value in values.items())
    for path in (written(tmp_path, as_yaml), written(tmp_path, json.dumps(values, indent=2), "car.json")):
        assert read_car(path) == Car(**{name.replace("-", "_"): value for name, value in values.items()})


def test_what_is_left_out_is_the_kiwi_car(tmp_path: Path) -> None:
    car = read_car(written(tmp_path, '{"mass": 2e0, "gain-reverse": 0}'))
    assert (car.mass, car.gain_reverse, car.front) == (2, 0, KIWI.front)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", ":1: $: expected an object, found null"),
        ("mass: 1\n\nmas: 2\n", ":3: $.mas: nothing reads 'mas'"),
        ("mass: heavy\n", ":1: $.mass: expected a number, found"),
        ("mass: .nan\n", ":1: $.mass: expected a number"),
        ("front: 1\nmass: 0\n", ":2: $.mass: expected a number > 0.0, found"),
        ("pedal-reverse: 0.5\n", ":1: $.pedal-reverse: expected a number <= 0.0, found"),
        ("mass: [1\n", ":2: neither YAML nor JSON: "),
    ],
)
def test_mistakes_are_named_with_file_and_line(tmp_path: Path, text: str, sentence: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_car(path)
    assert str(caught.value).startswith(f"{path}{sentence}")
