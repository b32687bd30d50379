"""Positions of editors and of YAML in any text."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from lsprotocol.types import Position
from pygls.workspace import PositionCodec

from dodo_dsl.diagnostics import Span
from dodo_dsl.lsp.documents import Lines

TEXTS = st.text(st.sampled_from("ab: \n\r\x85\u2028ä€🚗"), max_size=30)
CODECS = st.sampled_from([PositionCodec("utf-16"), PositionCodec("utf-8"), PositionCodec("utf-32")])
ENCODINGS = {"utf-16": "utf-16-le", "utf-8": "utf-8", "utf-32": "utf-32-le"}
SIZES = {"utf-16": 2, "utf-8": 1, "utf-32": 4}


@given(TEXTS, CODECS, st.data())
@pytest.mark.thorough
def test_positions_count_the_units_since_the_last_break(text: str, codec: PositionCodec, data: st.DataObject) -> None:
    """Against Python's encoders; a position inside a line break is that of the line's end."""
    offset = data.draw(st.integers(0, len(text)))
    if text[offset - 1 : offset + 1] == "\r\n":
        offset -= 1
    lines = Lines(text, codec)
    found = lines.position(offset)
    before = text[:offset].replace("\r\n", "\n").replace("\r", "\n")
    units = len(before.rpartition("\n")[2].encode(ENCODINGS[str(codec.encoding)])) // SIZES[str(codec.encoding)]
    assert found == Position(before.count("\n"), units)
    assert lines.index(found) == offset


@pytest.mark.parametrize("text", ["a: 🚗\nb: x", "a: ä # \u2028c: y\nb: x", "\ufeffb: x", "a: 1\r\nb: x", "a: 1\rb: x"])
def test_a_mark_of_yaml_is_where_the_text_is(text: str) -> None:
    events = yaml.parse(text.removeprefix("\ufeff"), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    mark = next(e.start_mark for e in events if isinstance(e, yaml.ScalarEvent) and e.value == "x")
    lines = Lines(text, PositionCodec("utf-16"))
    span = Span("f", mark.line + 1, mark.column + 1)
    assert lines.text[lines.index(lines.range(span).start)] == "x"


def test_a_span_ends_with_its_line_or_the_text() -> None:
    lines = Lines("abc\ndef", PositionCodec("utf-16"))
    assert lines.range(Span("f", 1, 2, 99)).end == Position(0, 3)
    assert lines.range(Span("f", 9, 9, 9)).start == Position(1, 3)
    assert lines.range(Span("f", 1, 3, 0)).end == Position(0, 2)
