"""Choices of a matrix, and their placeholders."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.source import Mapping, plain
from dodo_dsl.spec.matrix import MAX_INSTANCES, PLACEHOLDERS, SLUG, choices, substitute
from tests.source.nodes import mapping


def test_every_choice_in_order() -> None:
    found, wrong = choices(mapping("matrix: {light: [dark, Bright sun], speed: [1, 2.5 m/s]}"))
    assert wrong == []
    assert [choice.label for choice in found] == [
        "[light=dark,speed=1]",
        "[light=dark,speed=2.5 m/s]",
        "[light=Bright sun,speed=1]",
        "[light=Bright sun,speed=2.5 m/s]",
    ]
    assert found[-1].slug == "--light-bright-sun--speed-2-5-m-s"


@pytest.mark.parametrize("text", ["a: 1", "matrix: 3", "matrix: {}", "matrix: {a: []}"])
def test_one_empty_choice_without_values(text: str) -> None:
    (choice,), _ = choices(mapping(text))
    assert (choice.label, choice.slug) == ("", "")


@given(st.lists(st.text(st.characters(codec="ascii", categories=["L", "N", "P"]), min_size=1, max_size=8), min_size=1))
def test_names_of_folders_are_unique_or_reported(values: list[str]) -> None:
    items = ", ".join('"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"' for value in values)
    found, wrong = choices(mapping(f"matrix: {{a: [{items}]}}"))
    slugs = [choice.slug for choice in found]
    assert wrong or (len(set(slugs)) == len(slugs) and all(SLUG.fullmatch(f"t{slug}") for slug in slugs))


@pytest.mark.parametrize(
    ("text", "rules"),
    [
        ("{yaw: [+1 deg, -1 deg, '!']}", ["matrix-value", "matrix-value"]),
        (f"{{a: {list(range(20))}, b: {list(range(20))}, c: {list(range(6))}}}", ["matrix-size"]),
        (f"{{a: [{'x' * 180}]}}", ["matrix-size"]),
    ],
)
def test_values_that_cannot_name_instances(text: str, rules: list[str]) -> None:
    found, wrong = choices(mapping(f"matrix: {text}"))
    assert [problem.rule for problem in wrong] == rules
    assert len(found) <= MAX_INSTANCES


def test_placeholders_and_their_problems() -> None:
    node = mapping(
        "matrix: {a: [1], b: [2]}\nx: ${matrix.a}\ny: ['at ${matrix.c}', '${ matrix.a }', '${matrix}', '${HOME}']\n"
    )
    assert PLACEHOLDERS.names(node) == {"a", "c"}
    assert [problem.span.column for problem in PLACEHOLDERS.unknown(node, "matrix-unknown")] == [5, 23, 40]
    assert [problem.span.column for problem in PLACEHOLDERS.idle(node, "matrix-unused")] == [18]


def test_substitution() -> None:
    node = mapping(
        "matrix: {a: [1], b: [x]}\nwhole: ${matrix.a}\npart: ${matrix.a} ${matrix.b} ${matrix.c}\nkept: {d: [e]}\n"
    )
    (choice,), _ = choices(node)
    found = substitute(node, choice)
    assert isinstance(found, Mapping)
    assert plain(found)["whole"] == 1
    assert plain(found)["part"] == "1 x ${matrix.c}"
    assert found.entries["kept"].value is node.entries["kept"].value
    assert found.entries["whole"].value.span == node.entries["whole"].value.span
