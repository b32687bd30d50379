"""Choices of a matrix, and their placeholders."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.source import Mapping, plain
from dodo_dsl.spec.matrix import MAX_INSTANCES, PLACEHOLDERS, SLUG, choices, problems, substitute
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


def test_values_that_are_alike() -> None:
    _, wrong = choices(mapping("matrix: {yaw: [+1 deg, -1 deg, '!']}"))
    assert [problem.message for problem in wrong] == [
        "'-1 deg' and '+1 deg' of 'yaw' would both be called '1-deg'",
        "'!' has no letter or digit, so it cannot name an instance of 'yaw'",
    ]


def test_too_many_instances() -> None:
    ten = "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]"
    found, (problem,) = choices(mapping(f"matrix: {{a: {ten}, b: {ten}, c: {ten}, d: [0, 1, 2]}}"))
    assert len(found) == 1
    assert problem.message == f"the matrix has 3000 instances, expected at most {MAX_INSTANCES}"


def test_names_that_are_too_long() -> None:
    _, (problem,) = choices(mapping(f"matrix: {{a: [{'x' * 180}]}}"))
    assert problem.rule == "matrix-size"


def test_placeholders_and_their_problems() -> None:
    node = mapping(
        "matrix: {a: [1], b: [2]}\nx: ${matrix.a}\ny: ['at ${matrix.c}', '${ matrix.a }', '${matrix}', '${HOME}']\n"
    )
    assert PLACEHOLDERS.names(node) == {"a", "c"}
    assert [(problem.rule, problem.message) for problem in problems(node)] == [
        ("matrix-unknown", "the matrix has no dimension 'c'"),
        ("matrix-unknown", "'${ matrix.a }' is not a placeholder, expected ${matrix.a}"),
        ("matrix-unknown", "'${matrix}' is not a placeholder, expected one such as ${matrix.light}"),
    ]
    unused = mapping("matrix: {a: [1], b: [2]}\nx: ${matrix.a}\n")
    assert [(problem.rule, problem.message) for problem in problems(unused)] == [
        ("matrix-unused", "nothing uses ${matrix.b}, so its instances are all the same")
    ]


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
