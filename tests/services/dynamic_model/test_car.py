import json
from dataclasses import asdict
from pathlib import Path

import pytest

from dodo_dsl.opendlv.assets.car import KEYS, KIWI, read_car
from dodo_dsl.opendlv.assets.problem import InputError


def written(folder: Path, text: str, name: str = "car.yml") -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_yaml_and_json_say_the_same(tmp_path: Path) -> None:
    values = {key: getattr(KIWI, name) * 1.5 for key, name in KEYS.items()}
    as_yaml = "# a heavier car\n" + "".join(f"{key}: {value!r}\n" for key, value in values.items())
    for path in (written(tmp_path, as_yaml), written(tmp_path, json.dumps(values, indent=2), "car.json")):
        assert asdict(read_car(path)) == {name: values[key] for key, name in KEYS.items()}


def test_what_is_left_out_is_the_kiwi_car(tmp_path: Path) -> None:
    car = read_car(written(tmp_path, '{"mass": 2e0, "gain-reverse": 0}'))
    assert (car.mass, car.gain_reverse, car.front) == (2, 0, KIWI.front)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", ":1: expected the parameters of a car"),
        ("- mass\n", ":1: expected the parameters of a car"),
        ("mass: 1\n\nmas: 2\n", ":3:1: unknown parameter 'mas', did you mean 'mass'?"),
        ("mass: heavy\n", ":1:1: mass is not a finite number"),
        ("mass: '1'\n", ":1:1: mass is not a finite number"),
        ("mass: [1]\n", ":1:1: mass is not a finite number"),
        ("mass: nan\n", ":1:1: mass is not a finite number"),
        ("front: 1\nmass: 0\n", ":2:1: mass is 0, expected more than 0"),
        ("gain-forward: -1\n", ":1:1: gain-forward is -1, expected 0 or more"),
        ("pedal-reverse: 0.5\n", ":1:1: pedal-reverse is 0.5, expected 0 or less"),
        ("mass: 1\nmass: 2\n", ":2:1: mass appears twice"),
        ("mass: [1\n", ":2: neither YAML nor JSON: "),
    ],
)
def test_mistakes_are_named_with_file_and_line(tmp_path: Path, text: str, sentence: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_car(path)
    assert str(caught.value).startswith(f"{path}{sentence}")
