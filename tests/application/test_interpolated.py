"""Variables of compose files filled in as far as their values are known."""

import pytest

from dodo_dsl.application import interpolation
from dodo_dsl.source import plain
from tests.source.nodes import mapping

KNOWN = {"A": "a", "EMPTY": ""}


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("plain", "plain"),
        ("${A}/x", "a/x"),
        ("$A$A", "aa"),
        ("${B:-/}", "/"),
        ("${B:-${C:-${A}}}", "a"),
        ("${EMPTY:-d}|${EMPTY-d}", "d|"),
        ("${A:+/etc}", "/etc"),
        ("${B:+/etc}", ""),
        ("$$A", "$A"),
        ("${B}", "${B}"),
        ("${A}${B}", "${A}${B}"),
        ("${B:-$C}", "${B:-$C}"),
        ("${B:?name it}", "${B:?name it}"),
    ],
)
def test_texts(written: str, expected: str) -> None:
    assert interpolation.interpolated(written, KNOWN) == expected


def test_values_and_nodes_are_filled_alike() -> None:
    written = mapping("a: [1, '${A}', {b: '${B:-x}'}]\nc: true\n")
    assert interpolation.interpolated(plain(written), KNOWN) == {"a": [1, "a", {"b": "x"}], "c": True}
    seen = interpolation.interpolated_node(written, KNOWN)
    assert plain(seen) == {"a": [1, "a", {"b": "x"}], "c": True}
    assert seen.span == written.span


def test_the_variables_that_are_known() -> None:
    own = {"A": "a", "B": "${A}-${HOST}", "CI_TOKEN": "own"}
    outside = {"A": "outside", "HOST": "h", "CI_TOKEN": "pipeline", "X_KEY": "k", "Y_KEY": "k", "USER": "u"}
    assert interpolation.known_variables(own, outside, "/team", ["Y_KEY", "HOST"]) == {
        "A": "a",
        "B": "a-h",
        "CI_TOKEN": "own",
        "HOST": "h",
        "USER": "u",
        "Y_KEY": "k",
        "PWD": "/team",
    }
