"""Points of the ranges as values of a spec."""

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.search.space import Space, course, nominal, sweep, texts
from dodo_dsl.spec import vary
from tests.source.nodes import mapping


def space(text: str, *whole: str) -> Space:
    ranges, problems = vary.read(mapping(f"vary: {text}"))
    assert problems == []
    return Space(ranges, frozenset(whole))


ONE = space(
    "{x: {from: -8 cm, to: 0.1 m, nominal: 0 cm}, n: {from: 0, to: 3, nominal: 1}, m: {among: [a, b], nominal: b}}", "n"
)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.0, 0.0, 0.0), {"x": "-8 cm", "n": "0", "m": "a"}),
        ((0.5, 0.49, 0.49), {"x": "1 cm", "n": "1", "m": "a"}),
        ((1 / 3, 0.75, 0.5), {"x": "-2 cm", "n": "3", "m": "b"}),
        ((1.0, 1.0, 1.0), {"x": "10 cm", "n": "3", "m": "b"}),
    ],
)
def test_values_of_a_point(point: tuple[float, ...], expected: dict[str, str]) -> None:
    assert texts(ONE.values(point)) == expected


def test_bare_numbers_are_numbers_of_the_spec() -> None:
    assert ONE.values((0.5, 0.5, 0.5))["n"].value == 2
    assert space("{e: {from: 0.3, to: 2, nominal: 1}}").values((0.25,))["e"].value == 0.725


@given(
    st.decimals(-(10**6), 10**6, allow_nan=False, places=3),
    st.decimals(1, 10**6, allow_nan=False, places=3),
    st.floats(0, 1),
)
def test_values_stay_within_their_range_and_short(low: Decimal, width: Decimal, share: float) -> None:
    one = space(f"{{a: {{from: {low} m, to: {low + width} m, nominal: {low} m}}}}")
    text = one.values((share,))["a"].text
    number = one.ranges[0].number(text)
    assert low <= number <= low + width
    assert abs(float(number - low) - share * float(width)) <= float(width) / 1000


def test_a_longer_sweep_begins_with_the_shorter_one() -> None:
    long = [texts(values) for values in sweep(ONE, 33, 7)]
    assert [texts(values) for values in sweep(ONE, 5, 7)] == long[:5]
    assert len({tuple(one.items()) for one in long}) > 30
    assert [texts(values) for values in sweep(ONE, 5, 8)] != long[:5]


def test_the_nominal_values() -> None:
    assert texts(nominal(ONE)) == {"x": "0 cm", "n": "1", "m": "b"}


def test_a_search_drives_by_turns_evenly_and_at_the_ends() -> None:
    found = list(course(ONE, 40, 7))
    swept = [texts(one.values) for one in found if one.swept]
    assert swept == [texts(values) for values in sweep(ONE, len(swept), 7)]
    others = [texts(one.values) for one in found[1:8:2]]
    assert sorted((one["x"], one["n"]) for one in others) == [
        ("-8 cm", "0"),
        ("-8 cm", "3"),
        ("10 cm", "0"),
        ("10 cm", "3"),
    ]
    assert all(one.swept for one in (*found[::2], *found[8:])), "there are four corners"
    assert list(course(ONE, 9, 7)) == found[:9]
    assert list(course(ONE, 9, 2**32 - 1))
