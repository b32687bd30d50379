"""Words of a specification and their places."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.odvd import OdvdError, tokens


def words(text: str) -> list[tuple[str, str, str]]:
    return [(token.kind, token.text, str(token.place)) for token in tokens(text, "f")]


def test_kinds_and_places() -> None:
    assert words("package a.b; // no\n  x = -1.5\n/* a\n b */'c' \"d\ne\" [") == [
        ("name", "package", "f:1:1"),
        ("name", "a.b", "f:1:9"),
        ("sign", ";", "f:1:12"),
        ("name", "x", "f:2:3"),
        ("sign", "=", "f:2:5"),
        ("number", "-1.5", "f:2:7"),
        ("char", "c", "f:4:6"),
        ("string", "d\ne", "f:4:10"),
        ("sign", "[", "f:5:4"),
        ("end", "", "f:5:5"),
    ]


@given(st.text("ab.\n /*\"'[]{};=,09-é", max_size=40))
def test_every_text_is_words_or_an_error_at_its_place(text: str) -> None:
    try:
        found = list(tokens(text, "f"))
    except OdvdError as error:
        _, line, column = str(error).split(": ")[0].split(":")
        assert text.split("\n")[int(line) - 1][int(column) - 1 :], "the place is in the text"
        return
    assert found[-1].kind == "end"
    places = [(token.place.line, token.place.column) for token in found]
    assert places == sorted(places)
    for token in found[:-1]:
        line = text.split("\n")[token.place.line - 1]
        rest, first = line[token.place.column - 1 :], token.text.split("\n")[0]
        assert rest.startswith(first) or (rest[0] in "\"'" and rest[1:].startswith(first))


@pytest.mark.parametrize("text", ["?", "é", "\x00", "'ab'", "/* open", '"open'])
def test_what_is_not_allowed(text: str) -> None:
    with pytest.raises(OdvdError, match=r"^f:1:1: '.' is not allowed here$" if text != "\x00" else "^f:1:1: "):
        list(tokens(text, "f"))
