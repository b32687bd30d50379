"""The data of a page is one JSON value in a script, whatever is in it."""

import base64
import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.report.viewer.encoded import packed, script, shown

VALUES = st.recursive(st.none() | st.integers() | st.text(), st.lists, max_leaves=20)


@given(VALUES)
@pytest.mark.thorough
def test_a_script_holds_one_value_and_no_tag(value: object) -> None:
    text = script(value)
    begin, _, rest = text.partition(" = ")
    assert begin == "var dodoTest"
    assert json.loads(rest.removesuffix(";\n")) == value
    assert text.isascii() and "<" not in text and "\n" not in text[:-1]


def test_a_number_that_no_json_holds_is_refused() -> None:
    with pytest.raises(ValueError, match="JSON"):
        script(float("nan"))


def test_numbers_are_packed_as_32_bit_floats() -> None:
    numbers = struct.unpack("<3f", base64.b64decode(packed([1.5, -2, 1e300])))
    assert numbers == (1.5, -2, float("inf"))


@pytest.mark.parametrize(
    ("text", "line"),
    [("a\nb", "a�b"), ("\u202eevil", "�evil"), ("\x1b[31mred", "�[31mred"), ("x" * 5, "xxx … (5 characters)")],
)
def test_text_of_others_is_one_line(text: str, line: str) -> None:
    assert shown(text, 3 if text == "xxxxx" else 100) == line
