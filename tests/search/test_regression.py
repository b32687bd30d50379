"""Tests of failures: their names."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dodo_dsl.search.shrinking import name_of

LONG = "sil-" + "-".join(["chicane"] * 7)


@pytest.mark.parametrize(
    ("test", "changed", "taken", "name"),
    [
        ("sil-chicane", ["light"], set(), "sil-chicane-fails-at-light"),
        ("sil-chicane", ["light", "Start_y"], set(), "sil-chicane-fails-at-light-start-y"),
        ("sil-chicane", [], set(), "sil-chicane-fails-at-nominal"),
        ("sil-chicane", ["a"], {"sil-chicane-fails-at-a"}, "sil-chicane-fails-at-a-2"),
        (LONG, ["light"], set(), "sil-chicane-chicane-chicane-chicane-chicane-c-fails-at-light"),
        (LONG, ["bend" * 20], set(), "sil-chicane-chicane-fails-at-bendbendbendbendbendbendbendben"),
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
