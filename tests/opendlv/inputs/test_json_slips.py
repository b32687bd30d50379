"""What is wrong with text that is not JSON, one mistake a line."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.json_file import loads
from dodo_dsl.opendlv.assets.problem import InputError

FILE = Path("map.json")
SLIPS = [
    ('{"a": [1, 2,]}', "1:12: not JSON: expected a closing bracket, found ','"),
    ('{"a": 1,\n}', "1:8: not JSON: expected a closing bracket, found ','"),
    ('{"a": [1\n 2]}', "2:2: not JSON: expected a comma or a closing bracket, found '2'"),
    ('{"a": [1, 2}', "1:12: not JSON: expected a comma or a closing bracket, found '}'"),
    ('{"a": [1]', "1:10: not JSON: expected a comma or a closing bracket, found the end of the file"),
    ("[90 deg]", "1:5: not JSON: expected a comma or a closing bracket, found 'deg'"),
    ("[-0.25, .5]", "1:9: not JSON: expected a value: a text in double quotes, a number such as -0.5"),
    ('{"a": 1 // x\n}', "1:9: not JSON: expected a comma or a closing bracket, found '/'"),
    ("{'a': 1}", "1:2: not JSON: expected a key in double quotes, found"),
    ('["x, 1]', '1:2: not JSON: expected a text that ends with " in its line'),
    ('["a\\p"]', "1:4: not JSON: expected \\\\ for a backslash, or / in a path"),
    ('["a\tb"]', "1:4: not JSON: expected a text without tabs and line breaks"),
    ("[1]]", "1:4: not JSON: expected nothing more, as the JSON ends before, found ']'"),
    ('{"a" 1}', "1:6: not JSON: expected ':' behind the key, found '1'"),
    (" \n", "not JSON: expected a value"),
    ("model:", "1:1: not JSON: expected a value"),
    ('[{"b": {"a": 1}}, {"a": {}, "a": 2}]', "$[1].a: the key 'a' appears twice in one object"),
]


@pytest.mark.parametrize(("text", "said"), SLIPS)
def test_a_slip_has_its_place(text: str, said: str) -> None:
    with pytest.raises(InputError) as raised:
        loads(FILE, text)
    assert said in str(raised.value)


@given(st.text(alphabet="{}[]\",:\\1.-e \n\tabnul/#'", max_size=12))
def test_what_is_not_json_has_a_place_within_the_text(text: str) -> None:
    try:
        read = json.loads(text, object_pairs_hook=once)
    except ValueError:
        with pytest.raises(InputError) as raised:
            loads(FILE, text)
        line, column = raised.value.position()
        lines = text.split("\n")
        assert 1 <= line <= len(lines)
        assert 1 <= column <= len(lines[line - 1]) + 1
        assert "\n" not in raised.value.what + raised.value.hint
    else:
        assert repr(loads(FILE, text)) == repr(read)


def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError
    return dict(pairs)
