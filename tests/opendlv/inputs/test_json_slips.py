"""What is wrong with text that is not JSON, one mistake a line."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.json_file import JsonError, loads

_NUMBER = "write digits before and behind the point, as in 0.5, and no other zero or plus before them"
_VALUE = "a value is a text in double quotes, a number, true, false, null, [...] or {...}"
SLIPS = [
    ('{"a": [1, 2,]}', 12, "a comma before the closing ']'", "remove it: JSON has none there"),
    ('{"a": 1,}', 8, "a comma before the closing '}'", "remove it: JSON has none there"),
    ('{"a": [1\n 2]}', 8, "a comma is missing behind this value", "write ',' here"),
    ('{"a": "x" "b": 1}', 9, "a comma is missing behind this value", "write ',' here"),
    ("[-0.25, .5]", 9, "'.5' is not a number of JSON", _NUMBER),
    ("[+05.]", 2, "'+05.' is not a number of JSON", _NUMBER),
    ("[-05]", 2, "'-05' is not a number of JSON", _NUMBER),
    ("[1, // x\n]", 5, "a comment, which JSON does not have", "remove it"),
    ('{"a": 1 # x\n}', 9, "a comment, which JSON does not have", "remove it"),
    ("{'a': 1}", 2, "other quotation marks than JSON has", 'write "..."'),
    ('["x, 1]', 2, "this quotation mark is not closed in its line", 'write " at the end of the text'),
    ('["a\\p"]', 4, "'\\p' means nothing in JSON", "write \\\\ for a backslash, or / in a path"),
    ('["a\tb"]', 4, "a tab or another control character within a text", "write \\t, or a space"),
    ('{"a": [1, 2}', 12, "'}' does not close '[' of line 1", "write ']' before it, or remove '}' if it is too many"),
    ('{"a": [1]', 1, "'{' is not closed", "write '}' where it ends"),
    ("[1]]", 4, "']' follows the end of the JSON", "remove it, or the bracket too many before it"),
    ('{"a" 1}', 4, "':' is missing behind this key", "write ':' and its value"),
    ("{a: 1}", 2, "'a' is not a key, which is a text in double quotes", 'write "a": and its value'),
    ("[None]", 2, "'None' is Python, not JSON", "write null, true or false"),
    ("[90 deg]", 5, "'deg' behind a value", "remove it: JSON has numbers without units, and other text in quotes"),
    ("[x]", 2, "not JSON: 'x' is not expected here", _VALUE),
    ("[1,, 2]", 4, "not JSON: ',' is not expected here", _VALUE),
    ('{"a": 1, "a": 2}', 10, 'the key "a" appears twice in one object', "keep one of them: only the last would count"),
    (
        '[{"b": {"a": 1}}, {"a": {}, "a": 2}]',
        29,
        'the key "a" appears twice in one object',
        "keep one of them: only the last would count",
    ),
    (" \n", 1, "the file is empty, expected JSON", "an object begins with { and ends with }"),
    ("model:", 1, "not JSON: 'model' is not expected here", _VALUE),
]


@pytest.mark.parametrize(("text", "column", "what", "hint"), SLIPS)
def test_a_slip_has_its_place_and_a_fix(text: str, column: int, what: str, hint: str) -> None:
    with pytest.raises(JsonError) as raised:
        loads(text)
    error = raised.value
    assert (error.line, error.column, error.what, error.hint) == (1, column, what, hint)


def test_lines_are_counted() -> None:
    with pytest.raises(JsonError) as raised:
        loads('{"a": [\n  1,\n  .5]}')
    assert (raised.value.line, raised.value.column) == (3, 3)


def test_what_python_reads_beyond_json_stays() -> None:
    read = loads('[1e5, -2E-3, NaN, -Infinity, true, null, "\\u00e9"]')
    assert str(read) == "[100000.0, -0.002, nan, -inf, True, None, 'é']"


@given(st.text(alphabet="{}[]\",:\\1.-e \n\tabnul/#'", max_size=12))
def test_what_is_not_json_has_a_place_within_the_text(text: str) -> None:
    try:
        read = json.loads(text, object_pairs_hook=once)
    except ValueError:
        with pytest.raises(JsonError) as raised:
            loads(text)
        lines = text.split("\n")
        assert 1 <= raised.value.line <= len(lines)
        assert 1 <= raised.value.column <= len(lines[raised.value.line - 1]) + 1
        assert "\n" not in raised.value.what + raised.value.hint
    else:
        assert repr(loads(text)) == repr(read)


def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError
    return dict(pairs)
