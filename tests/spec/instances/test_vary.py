"""Ranges of values, and their placeholders."""

from decimal import Decimal

import pytest

from dodo_dsl.source import Mapping, plain
from dodo_dsl.spec.vary import PLACEHOLDERS, Range, corners, nominal, read
from tests.source.nodes import mapping

RANGES = (
    "{light: {from: 0.3, to: 2, nominal: 1}, start: {from: -8 cm, to: 0.1 m, nominal: 0 cm}, "
    "map: {among: [a, b, c], nominal: b}}"
)


def ranges(text: str = RANGES) -> tuple[Range, ...]:
    found, wrong = read(mapping(f"vary: {text}"))
    assert wrong == []
    return found


def test_ranges_in_order() -> None:
    light, start, among = ranges()
    assert [(one.name, one.unit, one.is_list, one.text) for one in (light, start, among)] == [
        ("light", "", False, "0.3 to 2"),
        ("start", "cm", False, "-8 cm to 0.1 m"),
        ("map", "", True, "a, b, c"),
    ]
    assert [start.number(end.text) for end in start.ends] == [Decimal(-8), Decimal(10)]
    assert light.number(light.nominal.text) == 1


@pytest.mark.parametrize("text", ["a: 1", "vary: 3", "vary: {}", "vary: {a: 3}", "vary: {a: {nominal: [1]}}"])
def test_what_the_schema_reports_is_no_range(text: str) -> None:
    assert read(mapping(text))[0] == ()


def test_every_end_is_in_a_corner_and_the_rest_is_nominal() -> None:
    found = [{name: value.text for name, value in corner.items()} for corner in corners(ranges())]
    assert found == [
        {"light": "0.3", "start": "-8 cm", "map": "a"},
        {"light": "2", "start": "0.1 m", "map": "b"},
        {"map": "c"},
    ]
    assert {name: value.text for name, value in nominal(ranges()).items()} == {
        "light": "1",
        "start": "0 cm",
        "map": "b",
    }


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{from: 2, to: 1, nominal: 1}", "vary-range 2,"),
        ("{from: 1, to: 2, nominal: 3}", "vary-range 3}"),
        ("{from: 1 m, to: 2 m, nominal: 99 cm}", "vary-range 99"),
        ("{from: 1 m, to: 2, nominal: 1 m}", "wrong-unit 2,"),
        ("{from: 1, to: 2 m, nominal: 1}", "wrong-unit 2 m"),
        ("{from: .inf, to: 2, nominal: 1}", "vary-range .inf"),
        ("{among: [x, y], nominal: z}", "vary-range z"),
        ("{among: [x, x], nominal: x}", "vary-range x], "),
        ("{from: 1, nominal: 1}", "missing-key a:"),
        ("{among: [x, y]}", "missing-key a:"),
        ("{from: 1, to: 2, among: [1], nominal: 1}", "vary-range a:"),
    ],
)
def test_problems_of_a_range(text: str, expected: str) -> None:
    line = f"vary: {{a: {text}}}"
    _, (problem,) = read(mapping(line))
    assert f"{problem.rule} {line[problem.span.column - 1 :]}".startswith(expected)


def test_a_range_with_a_problem_keeps_its_nominal_value() -> None:
    ((one,), _) = read(mapping("vary: {a: {from: 2, to: 1, nominal: 1}}"))
    assert (one.nominal.text, one.ends) == ("1", ())


def unknown(written: str) -> list[str]:
    """The hints about a value."""
    node = mapping(f"vary: {{light: {{from: 0.3, to: 2, nominal: 1}}}}\nx: {written}\n")
    return [problem.hint for problem in PLACEHOLDERS.unknown(node, "vary-unknown")]


@pytest.mark.parametrize(
    "written",
    [
        *("${light}", "{vary.light}", "'{vary.light}'", "$(vary.light)", "${{ vary.light }}", "${vary.light"),
        *("$vary.light", "vary.light", "\u201c${vary.light}\u201d"),
    ],
)
def test_what_is_meant_as_a_placeholder(written: str) -> None:
    assert unknown(written) == ['write "${vary.light}"']


@pytest.mark.parametrize(
    "written",
    ["-${vary.light}", "(${vary.light})", "'${vary.light} %'", "light", "$HOME", "${HOME}", "{light}", "${light} lux"],
)
def test_what_is_fine_as_it_is(written: str) -> None:
    assert unknown(written) == []


def test_a_value_keeps_the_place_where_it_is_written() -> None:
    node = mapping(f"vary: {RANGES}\nwhole: ${{vary.light}}\npart: at ${{vary.start}}\n")
    found = PLACEHOLDERS.filled(node, nominal(ranges()))
    assert isinstance(found, Mapping)
    assert plain(found)["whole"] == 1
    assert plain(found)["part"] == "at 0 cm"
    assert [found.entries[key].value.span.line for key in ("whole", "part")] == [1, 3]
