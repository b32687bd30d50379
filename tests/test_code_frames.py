"""Code frames fit into the terminal, and show the place that they are about."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dodo_dsl.diagnostics import Diagnostic, Span, forget_lines, format_text
from dodo_dsl.terminal import excerpt, printable

LINES = st.text(st.sampled_from("abc {}:,…\t\x1b\x00漢ßÄ\u200b\ufeff"), max_size=400)


@given(LINES, st.integers(0), st.integers(1, 200_000), st.integers(12, 300))
@example("x" * 250, 200, 1, 74)
@example("", 0, 1, 12)
@example("a: " + "b" * 100_000, 3, 100_000, 74)
@pytest.mark.thorough
def test_the_place_of_any_line_is_shown_in_any_width(line: str, number: int, length: int, room: int) -> None:
    start = number % (len(line) + 1)
    before, place, behind = excerpt(line, start, length, room)
    assert len(before + place + behind) <= room
    assert place or start == len(line)
    assert printable(line[start : start + length]).startswith(place)
    assert any(printable(line[:start]).endswith(end) for end in (before, before.removeprefix("…")))
    rest = printable(line[start + len(place) :])
    assert any(rest.startswith(begin) for begin in (behind, behind.removesuffix("…")))
    if len(line) <= room:
        assert before + place + behind == printable(line)


@given(st.lists(st.tuples(LINES, st.integers(0), st.integers(1, 500)), min_size=1, max_size=3), st.integers(30, 200))
@example([("a" * 24, 24, 1)], 30)
@pytest.mark.thorough
def test_each_frame_of_several_has_carets_below_its_place(
    tmp_path_factory: pytest.TempPathFactory, places: list[tuple[str, int, int]], width: int
) -> None:
    file = tmp_path_factory.mktemp("frames") / "a.yml"
    file.write_text("".join(f"{line}\n" for line, _, _ in places), encoding="utf-8")
    forget_lines()
    spans = [Span(str(file), n, at % (len(line) + 1) + 1, long) for n, (line, at, long) in enumerate(places, 1)]
    for span, (line, _, _) in zip(spans, places, strict=True):
        _, above, below = format_text([Diagnostic(span, "wrong-value", "wrong")], width).splitlines()
        assert max(len(above), len(below)) <= width
        assert set(below.strip(" |")) == {"^"}
        at = below.index("^")
        assert above[at : at + 1] == printable(line[span.column - 1 : span.column]), (above, below)
