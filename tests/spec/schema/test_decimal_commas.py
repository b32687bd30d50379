"""Decimal commas in flow mappings."""

import pytest

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Mapping, plain
from dodo_dsl.spec.slips import joined
from tests.source.nodes import mapping


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{z: 9,5 cm}", {"z": "9,5 cm"}),
        ("{z: -9,5, x: 1,25 m/s}", {"z": "-9,5", "x": "1,25 m/s"}),
        ("{a: {z: 9,5 %}}", {"a": {"z": "9,5 %"}}),
        ("{z: 9, 5 cm}", {"z": 9, "5 cm": None}),
        ("{z: 9.1,5 cm}", {"z": 9.1, "5 cm": None}),
        ("{z: a,5 cm}", {"z": "a", "5 cm": None}),
        ("{z: 9,5 cm: 1}", {"z": 9, "5 cm": 1}),
        ("{z: 9,five}", {"z": 9, "five": None}),
        ("z: 9\n5 cm:\n", {"z": 9, "5 cm": None}),
    ],
)
def test_values_in_one_piece(text: str, expected: object) -> None:
    assert plain(joined(mapping(text))) == expected


def test_the_place_of_the_whole() -> None:
    node = joined(mapping("{z: 9,5 cm}"))
    assert isinstance(node, Mapping)
    assert node.entries["z"].value.span == Span("x.yml", 1, 5, 6)
