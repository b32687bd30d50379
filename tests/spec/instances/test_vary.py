"""Ranges of values, and their placeholders."""

from decimal import Decimal

import pytest

from dodo_dsl.source import Mapping, plain
from dodo_dsl.spec.vary import PLACEHOLDERS, Range, corners, nominal, problems, read
from tests.source.nodes import mapping

RANGES = (
    "{light: {from: 0.3, to: 2, nominal: 1}, start: {from: -8 cm, to: 0.1 m, nominal: 0 cm}, "
    "map: {among: [a, b, c], nominal: b}}"
)


def ranges(text: str = RANGES) -> tuple[Range, ...]:
    found, wrong = read(mapping(f"vary: {text}"))
    assert wrong == []
    return found


def said(text: str) -> list[tuple[str, str, str]]:
    """The rule, what it underlines, and the message."""
    line = f"vary: {{a: {text}}}"
    _, wrong = read(mapping(line))
    return [(d.rule, line[d.span.column - 1 :][: d.span.length], d.message) for d in wrong]


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
        ("{from: 2, to: 1, nominal: 1}", ("vary-range", "2", "'from' is 2, expected less than 'to', 1")),
        ("{from: 1, to: 2, nominal: 3}", ("vary-range", "3", "'nominal' is 3, expected 1 to 2")),
        ("{from: 1 m, to: 2 m, nominal: 99 cm}", ("vary-range", "99 cm", "'nominal' is 99 cm, expected 1 m to 2 m")),
        ("{from: 1 m, to: 2, nominal: 1 m}", ("wrong-unit", "2", "'to': '2' has no unit, expected a length in m")),
        ("{from: 1, to: 2 m, nominal: 1}", ("wrong-unit", "2 m", "'to': '2 m' is not a number without a unit")),
        (
            "{from: .inf, to: 2, nominal: 1}",
            ("vary-range", ".inf", "'from' is '.inf', expected a number or a quantity"),
        ),
        ("{among: [x, y], nominal: z}", ("vary-range", "z", "'nominal' is 'z', expected one of x, y")),
        ("{among: [x, x], nominal: x}", ("vary-range", "x", "'x' stands twice in 'among'")),
        ("{from: 1, nominal: 1}", ("missing-key", "a", "range 'a' has no 'to'")),
        ("{among: [x, y]}", ("missing-key", "a", "range 'a' has no 'nominal'")),
        (
            "{from: 1, to: 2, among: [1], nominal: 1}",
            ("vary-range", "a", "range 'a' has 'among' beside 'from' or 'to', expected one of them"),
        ),
    ],
)
def test_problems_of_a_range(text: str, expected: tuple[str, str, str]) -> None:
    assert said(text) == [expected]


def test_a_range_with_a_problem_keeps_its_nominal_value() -> None:
    ((one,), _) = read(mapping("vary: {a: {from: 2, to: 1, nominal: 1}}"))
    assert (one.nominal.text, one.ends) == ("1", ())


def test_placeholders_and_their_problems() -> None:
    node = mapping(f"vary: {RANGES}\nx: ${{vary.light}}\ny: ['at ${{vary.c}}', '${{ vary.start }}', '${{matrix.b}}']\n")
    assert [(problem.rule, problem.message) for problem in problems(node)] == [
        ("vary-unknown", "'vary' has no range 'c'"),
        ("vary-unknown", "'${ vary.start }' is not a placeholder, expected ${vary.start}"),
    ]
    unused = mapping(f"vary: {RANGES}\nx: ${{vary.light}}\n")
    assert [(problem.rule, problem.message) for problem in problems(unused)] == [
        ("vary-unused", "nothing uses ${vary.start}, so a search would vary nothing by it"),
        ("vary-unused", "nothing uses ${vary.map}, so a search would vary nothing by it"),
    ]


@pytest.mark.parametrize(
    "written",
    [
        "${light}",
        "{vary.light}",
        "'{vary.light}'",
        "$(vary.light)",
        "${{ vary.light }}",
        "${vary.light",
        "$vary.light",
        "vary.light",
        "\u201c${vary.light}\u201d",
    ],
)
def test_what_is_meant_as_a_placeholder(written: str) -> None:
    (problem,) = problems(mapping(f"vary: {{light: {{from: 0.3, to: 2, nominal: 1}}}}\nx: {written}\n"))
    assert (problem.rule, problem.hint) == ("vary-unknown", 'write "${vary.light}"')


@pytest.mark.parametrize("written", ["-${vary.light}", "(${vary.light})", "'${vary.light} %'", "'${vary.light}'"])
def test_signs_beside_a_placeholder(written: str) -> None:
    assert list(problems(mapping(f"vary: {{light: {{from: 0.3, to: 2, nominal: 1}}}}\nx: {written}\n"))) == []


@pytest.mark.parametrize("written", ["light", "$HOME", "${HOME}", "{light}", "${light} lux", "varying.light"])
def test_what_is_no_placeholder(written: str) -> None:
    (problem,) = problems(mapping(f"vary: {{light: {{from: 0.3, to: 2, nominal: 1}}}}\nx: {written}\n"))
    assert problem.rule == "vary-unused"


def test_a_value_keeps_the_place_where_it_is_written() -> None:
    node = mapping(f"vary: {RANGES}\nwhole: ${{vary.light}}\npart: at ${{vary.start}}\n")
    found = PLACEHOLDERS.filled(node, nominal(ranges()))
    assert isinstance(found, Mapping)
    assert plain(found)["whole"] == 1
    assert plain(found)["part"] == "at 0 cm"
    assert [found.entries[key].value.span.line for key in ("whole", "part")] == [1, 3]
