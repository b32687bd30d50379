"""Positions of editors and of YAML."""

import pytest
import yaml
from lsprotocol.types import Position
from pygls.workspace import PositionCodec

from dodo_dsl.diagnostics import Span
from dodo_dsl.lsp.documents import Lines


@pytest.mark.parametrize(
    ("text", "line", "units"),
    [
        ("a: 🚗\n🚗b: x", 1, 5),
        ("\ufeffb: x", 0, 3),
        ("a: 1\r\nb: x", 1, 3),
        ("a: 1\rb: x", 1, 3),
        ("a: ä # \u2028c: y\nb: x", 1, 3),
    ],
)
def test_a_mark_of_yaml_is_where_the_text_is(text: str, line: int, units: int) -> None:
    events = yaml.parse(text.removeprefix("\ufeff"), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    mark = next(e.start_mark for e in events if isinstance(e, yaml.ScalarEvent) and e.value == "x")
    lines = Lines(text, PositionCodec("utf-16"))
    span = Span("f", mark.line + 1, mark.column + 1)
    assert lines.text(span) == "x"
    assert lines.range(span).start == Position(line, units)


def test_a_span_ends_with_its_line_or_the_text() -> None:
    lines = Lines("abc\ndef", PositionCodec("utf-16"))
    assert lines.range(Span("f", 1, 2, 99)).end == Position(0, 3)
    assert lines.range(Span("f", 9, 9, 9)).start == Position(1, 3)
    assert lines.range(Span("f", 1, 3, 0)).end == Position(0, 2)
