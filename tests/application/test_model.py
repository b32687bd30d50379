"""Values of compose files as compose reads them, and what services declare."""

from typing import Any

import pytest

from dodo_dsl.application.model import declared, environment, plain, scalars, text
from tests.source.nodes import mapping, value


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("0440", 0o440),
        ("0890", 890),
        ("10", 10),
        ("99999999999999999999", 1e20),
        ("[1, {a: 010}]", [1, {"a": 8}]),
        ("true", True),
    ],
)
def test_plain_values(written: str, expected: object) -> None:
    found = plain(value(written))
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize(("value", "expected"), [(True, "true"), (1e20, "1" + "0" * 20), (0.5, "0.5"), ("x", "x")])
def test_values_as_strings(value: object, expected: str) -> None:
    assert text(value) == expected


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (["A=1", "B", "C=a=b", "D="], {"A": "1", "B": None, "C": "a=b", "D": ""}),
        ({"A": 1, "B": None, "C": False}, {"A": "1", "B": None, "C": "false"}),
        (None, {}),
    ],
)
def test_environments(raw: Any, expected: dict[str, str | None]) -> None:
    assert environment(raw) == expected


def test_declarations() -> None:
    assert declared(mapping("image: x")) is None
    assert declared(mapping("x-dodo:")) is None
    found = declared(mapping("x-dodo: {in: [a.B], out: a.C/3, answers: [a.C], done: a.D, readers: 2}"))
    assert found is not None
    words = [[name for name, _ in port] for port in (found.inputs, found.outputs, found.answers)]
    assert words == [["a.B"], ["a.C/3"], ["a.C"]]
    assert found.done is not None
    assert (found.done[0], found.readers, found.span.line) == ("a.D", 2, 1)
    empty = declared(mapping("x-dodo: {}"))
    assert empty is not None
    assert (empty.inputs, empty.done, empty.readers) == ((), None, 0)


def test_what_is_printed_is_declared_as_sent_once() -> None:
    lines = "[{match: 'a(?P<x>.)$$', message: a.B}, {match: 'b(?P<x>.)$', message: a.B, sender: 3}]"
    found = declared(mapping(f"x-dodo: {{out: [a.B/0, a.C], lines: {lines}}}"))
    assert found is not None
    assert [name for name, _ in found.outputs] == ["a.B/0", "a.C", "a.B/3"]
    assert [(line.match, line.port) for line in found.lines] == [("a(?P<x>.)$", "a.B"), ("b(?P<x>.)$", "a.B/3")]


def test_strings_of_a_list_or_a_single_one() -> None:
    assert [s.text for s in scalars(value("[a, 3, {b: c}, d]"))] == ["a", "d"]
    assert [s.text for s in scalars(value("a"))] == ["a"]
    assert scalars(None) == []
