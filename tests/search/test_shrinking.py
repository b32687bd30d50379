"""Failures reduced, against areas in which drives fail, and the names of their tests."""

import asyncio
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dodo_dsl.search.shrinking import changed, distance, name_of, shrink
from dodo_dsl.search.space import nominal, texts
from dodo_dsl.spec.vary import Values
from tests.search.test_space import space

SPACE = space(
    "{x: {from: -8 cm, to: 8 cm, nominal: 0.33 cm}, y: {from: 0, to: 1, nominal: 1}, n: {from: 0, to: 90, nominal: 5}, "
    "m: {among: [a, b, c], nominal: b}}",
    "n",
)
Fails = Callable[[float, float, int, str], bool]


def fails(values: Values, rule: Fails) -> bool:
    given = texts(values)
    return rule(float(given["x"].split()[0]), float(given["y"]), int(given["n"]), given["m"])


def shrunk(start: tuple[float, ...], rule: Fails) -> tuple[Values, int]:
    """The values, and how many drives they took."""
    first = SPACE.values(start)
    assert fails(first, rule)
    number = 0

    async def asked(tried: list[Values]) -> list[bool]:
        nonlocal number
        number += len(tried)
        return [fails(values, rule) for values in tried]

    return asyncio.run(shrink(SPACE, first, asked)), number


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (lambda x, y, n, m: x > 5, {"x": "5.01 cm"}),
        (lambda x, y, n, m: x < -2.5, {"x": "-2.51 cm"}),
        (lambda x, y, n, m: n >= 40 and y < 0.25, {"y": "0.249", "n": "40"}),
        (lambda x, y, n, m: m == "c" and n != 5, {"n": "6", "m": "c"}),
        (lambda x, y, n, m: True, {}),
    ],
)
def test_what_is_left_is_what_it_takes(rule: Fails, expected: dict[str, str]) -> None:
    start = (0.99, 0.1, 0.9, 0.9) if "-" not in expected.get("x", "") else (0.01, 0.1, 0.9, 0.9)
    values, number = shrunk(start, rule)
    assert fails(values, rule)
    assert {name: texts(values)[name] for name in changed(SPACE, values)} == expected
    assert number < 50


def test_either_of_two_is_enough() -> None:
    values, _ = shrunk((0.99, 0.1, 0.9, 0.9), lambda x, y, n, m: x > 5 or n > 70)
    assert len(changed(SPACE, values)) == 1


def test_the_nearest_of_several() -> None:
    far, near = (SPACE.values(point) for point in [(0.9, 0.1, 0.9, 0.9), (0.6, 0.9, 0.1, 0.5)])
    assert distance(SPACE, far) > distance(SPACE, near) > distance(SPACE, nominal(SPACE)) == 0


LONG = "sil-" + "-".join(["chicane"] * 7)


@pytest.mark.parametrize(
    ("test", "changed", "taken", "name"),
    [
        ("sil-chicane", ["light"], set(), "sil-chicane-fails-at-light"),
        ("sil-chicane", ["light", "Start_y"], set(), "sil-chicane-fails-at-light-start-y"),
        ("sil-chicane", [], set(), "sil-chicane-fails-at-nominal"),
        ("sil-chicane", ["a"], {"sil-chicane-fails-at-a"}, "sil-chicane-fails-at-a-2"),
        (LONG, ["light"], set(), "sil-chicane-chicane-chicane-chicane-chic-fails-at-light"),
        (LONG, ["bend" * 20], set(), "sil-chicane-chicane-chicane-chicane-chic-fails-at-bendben"),
    ],
)
def test_a_test_is_named_after_what_was_shrunk(test: str, changed: list[str], taken: set[str], name: str) -> None:
    spec: Any = SimpleNamespace(location=SimpleNamespace(stem=test, path=Path()))
    assert name_of(spec, changed, taken) == name
    names: set[str] = set()
    for _ in range(5):
        names.add(name_of(spec, changed, names))
    assert len(names) == 5
    assert all(re.fullmatch("[a-z][a-z0-9]*(-[a-z0-9]+)*", one) and len(one) <= 60 and one != test for one in names)
