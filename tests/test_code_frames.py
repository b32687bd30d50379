"""Code frames fit into the terminal, and show the place that they are about."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dodo_dsl.diagnostics import Diagnostic, Span, forget_lines, format_text
from dodo_dsl.terminal import cells, excerpt, printable

CHARACTERS = st.sampled_from("abc {}:,…\t\x1b\x00漢字한👍e\u0301ßÄ\u200b\ufeff")
LINES = st.text(CHARACTERS, max_size=400)


@given(LINES, st.integers(0), st.integers(1, 200_000), st.integers(12, 300))
@example("x" * 250, 200, 1, 74)
@example("漢" * 100, 99, 1, 12)
@example("", 0, 1, 12)
@example("a: " + "b" * 100_000, 3, 100_000, 74)
@example("漢\t" * 50_000, 77_777, 9, 40)
@example("e" + "\u0301" * 100_000, 50_000, 9, 40)
@pytest.mark.thorough
def test_the_place_of_any_line_is_shown_in_any_width(line: str, number: int, length: int, room: int) -> None:
    start = number % (len(line) + 1)
    before, place, behind = excerpt(line, start, length, room)
    head, tail = before.removeprefix("…"), behind.removesuffix("…")
    assert cells(before + place + behind) <= room
    assert not place or printable(line[start : start + length]).startswith(place)
    assert place or start == len(line)
    for end in {head, before}:
        if printable(line[:start]).endswith(end) and printable(line[start + len(place) :]).startswith(tail):
            break
    else:
        raise AssertionError((before, place, behind))
    if max(len(line), cells(printable(line))) <= room - 2:
        assert before + place + behind == printable(line)


@given(st.lists(st.tuples(LINES, st.integers(0), st.integers(1, 500)), min_size=1, max_size=3), st.integers(30, 200))
@example([("a" * 24, 24, 1)], 30)
@example([("a" * 24 + "\u0301", 24, 1)], 30)
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
        carets = below.strip(" |")
        before = below[: below.index("^")]
        assert max(cells(above), cells(below)) <= width
        assert set(carets) == {"^"}
        seen, column = "", 0
        for character in above:
            if column == len(before) and cells(character):
                seen = character
                break
            column += cells(character)
        wanted = printable(line[span.column - 1 : span.column])
        assert seen == wanted or not cells(wanted), (above, below)
