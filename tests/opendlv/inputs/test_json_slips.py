"""What is wrong with text that is not JSON, one mistake a line."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.inputs.json_slips import JsonError, loads, slip_in

SLIPS = [
    ('{"a": [1, 2,]}', 12, "a comma before the closing ']'", "remove it: JSON has none there"),
    ('{"a": 1,}', 8, "a comma before the closing '}'", "remove it: JSON has none there"),
    ('{"a": [1\n 2]}', 8, "a comma is missing behind this value", "write ',' here"),
    ("[-0.25, .5]", 9, "'.5' is not a number of JSON", "write 0.5"),
    ("[+05.]", 2, "'+05.' is not a number of JSON", "write 5.0"),
    ("[1, // x\n]", 5, "a comment, which JSON does not have", "remove it"),
    ('{"a": 1 # x\n}', 9, "a comment, which JSON does not have", "remove it"),
    ("{'a': 1}", 2, "other quotation marks than JSON has", 'write "a"'),
    ('["x, 1]', 2, "this quotation mark is not closed in its line", 'write " at the end of the text'),
    ('{"a: "x"}', 2, "this quotation mark is not closed before the colon", 'write " at the end of the key'),
    ('["a\\p"]', 4, "'\\p' means nothing in JSON", "write \\\\ for a backslash, or / in a path"),
    ('["a\tb"]', 4, "a tab or another control character within a text", "write \\t, or a space"),
    ('{"a": [1, 2}', 12, "'}' does not close '[' of line 1", "write ']' before it, or remove '}' if it is too many"),
    ('{"a": [1]', 1, "'{' is not closed", "write '}' where it ends"),
    ("[1]]", 4, "']' follows the end of the JSON", "remove it, or the bracket too many before it"),
    ('{"a" 1}', 4, "':' is missing behind the key \"a\"", 'write "a": and its value'),
    ("{a: 1}", 2, "'a' is no key, which is a text in double quotes", 'write "a": and its value'),
    ('{, "a": 1}', 2, "a comma where a key is expected", "remove it"),
    ('["a": 1]', 5, "a colon that no key is before", "'[' opens a list: write {...} for keys with values"),
    ("[None]", 2, "'None' is Python, not JSON", "write null"),
    ("[90 deg]", 5, "'deg' behind a value", "remove it: JSON has numbers without units, and other text in quotes"),
    ("[x]", 2, "'x' is not a value of JSON", "write a text in double quotes"),
    ("[1,, 2]", 4, "a value is missing before ','", "write it, or remove what is too many"),
    ('{"a": 1, "a": 2}', 10, 'the key "a" appears twice in one object', "keep one of them: only the last would count"),
    (" \n", 1, "the file is empty, expected JSON", "an object begins with { and ends with }"),
    ("model:", 1, "not JSON, which begins with { or [: 'model'", ""),
]


@pytest.mark.parametrize(("text", "column", "what", "hint"), SLIPS)
def test_a_slip_has_its_place_and_a_fix(text: str, column: int, what: str, hint: str) -> None:
    with pytest.raises(JsonError) as raised:
        loads(text)
    error = raised.value
    assert (error.line, error.column, error.what, error.hint) == (1, column, what, hint)


@given(st.sampled_from(["'{}'", "`{}`", "{}", "+{}", "-{}"]), st.text("a\\0.5eE-'\"\tnN", max_size=40))
def test_what_a_hint_says_to_write_is_json(form: str, inner: str) -> None:
    slip = slip_in(f"[{form.format(inner)}]")
    value = slip.hint.removeprefix("write ") if slip and slip.hint.startswith("write ") else "0"
    if value[:1] in '"-0123456789' and value != '"..."' and " " not in value:
        json.loads(value)


def test_lines_are_counted() -> None:
    with pytest.raises(JsonError) as raised:
        loads('{"a": [\n  1,\n  .5]}')
    assert (raised.value.line, raised.value.column) == (3, 3)


def test_what_python_reads_beyond_json_stays() -> None:
    read = loads('[1e5, -2E-3, NaN, -Infinity, true, null, "\\u00e9"]')
    assert str(read) == "[100000.0, -0.002, nan, -inf, True, None, 'é']"


@given(st.text(alphabet="{}[]\",:\\1.-e \n\tabnul/#'", max_size=12))
def test_there_is_a_slip_in_what_is_not_json_and_in_nothing_else(text: str) -> None:
    slip = slip_in(text)
    try:
        json.loads(text, object_pairs_hook=once)
    except ValueError:
        assert slip is not None
        assert 0 <= slip.at <= len(text)
    else:
        assert slip is None


def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError
    return dict(pairs)
