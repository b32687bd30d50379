"""Choices of a matrix, and their placeholders."""

from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.source import Mapping, plain
from dodo_dsl.spec.matrix import PLACEHOLDERS, SLUG, choices
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


@given(st.lists(st.text(st.characters(codec="ascii", categories=["L", "N", "P"]), min_size=1, max_size=8), min_size=1))
def test_names_of_folders_are_unique_or_reported(values: list[str]) -> None:
    items = ", ".join('"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"' for value in values)
    found, wrong = choices(mapping(f"matrix: {{a: [{items}]}}"))
    slugs = [choice.slug for choice in found]
    assert wrong or (len(set(slugs)) == len(slugs) and all(SLUG.fullmatch(f"t{slug}") for slug in slugs))


def test_substitution() -> None:
    node = mapping(
        "matrix: {a: [1], b: [x]}\nwhole: ${matrix.a}\npart: ${matrix.a} ${matrix.b} ${matrix.c}\nkept: {d: [e]}\n"
    )
    (choice,), _ = choices(node)
    found = PLACEHOLDERS.filled(node, dict(choice.values))
    assert isinstance(found, Mapping)
    assert plain(found)["whole"] == 1
    assert plain(found)["part"] == "1 x ${matrix.c}"
    assert found.entries["kept"].value is node.entries["kept"].value
    assert found.entries["whole"].value.span == node.entries["whole"].value.span
