"""What is wrong with text that is not JSON, one mistake a line."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.assets.json_file import load
from dodo_dsl.opendlv.assets.problem import InputError

SLIPS = [
    ('{"a": [1, 2,]}', "1:13: not JSON: trailing comma in array"),
    ('{"a": [1\n 2]}', "2:2: not JSON: expected ',' or ']'"),
    ('{"a": [1]', "1:10: not JSON: input data was truncated"),
    ('{"å": 1 // x\n}', "1:9: not JSON: expected ',' or '}'"),
    ("{'a': 1}", "1:2: not JSON: object keys must be strings"),
    ('["a\\p"]', "1:6: not JSON: invalid escape character in string"),
    ("[NaN]", "1:2: not JSON: invalid character"),
    ("[1]]", "1:5: not JSON: trailing characters"),
    (" \n", "2:1: not JSON: input data was truncated"),
    ('[{"b": {"a": 1}}, {"a": {}, "a": 2}]', "$[1].a: the key 'a' appears twice in one object"),
    ('[{"a": {"b": 1, "b": 2}}]', "$[0].a.b: the key 'b' appears twice in one object"),
    ("[1e999]", "$[0]: Number out of range"),
]


@pytest.mark.parametrize(("text", "said"), SLIPS)
def test_a_slip_has_its_place(tmp_path: Path, text: str, said: str) -> None:
    (file := tmp_path / "map.json").write_text(text)
    with pytest.raises(InputError) as raised:
        load(file)
    assert said in str(raised.value)
