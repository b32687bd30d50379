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


def unknown(written: str) -> list[str]:
    """The hints about a value."""
    node = mapping(f"vary: {{light: {{from: 0.3, to: 2, nominal: 1}}}}\nx: {written}\n")
    return [problem.hint for problem in PLACEHOLDERS.unknown(node)]


@pytest.mark.parametrize("written", ["${{ vary.light }}", "${vary.light", "${ vary.light }"])
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
