"""The cursor in texts that are no YAML yet."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.lsp.completion import cursor
from dodo_dsl.lsp.documents import Steps
from tests.lsp.conftest import SPEC

HEAD = "name: x\nenvironment:\n  camera:"
WITH = ("environment", "camera", "with")


@pytest.mark.parametrize(
    ("text", "steps", "is_key", "word"),
    [
        ("name: x\nle|", (), True, "le"),
        ("name: x\nlevel: s|", ("level",), False, "s"),
        (f"{HEAD}\n    |", ("environment", "camera"), True, ""),
        (f"{HEAD} {{us|", ("environment", "camera"), True, "us"),
        (f"{HEAD} {{uses: virt|}}", ("environment", "camera", "uses"), False, "virt"),
        (f"{HEAD} {{uses: a, with: {{x: 1, fr|", WITH, True, "fr"),
        (f"{HEAD} {{uses: a, with: {{x: 1, freq: 10 H|", (*WITH, "freq"), False, "H"),
        (f"{HEAD}\n    uses: a\n    with:\n      x: 1\n      name.a|", WITH, True, "name.a"),
        (f"{HEAD}\n    uses: a\n    with:\n      |", WITH, True, ""),
        (f"{HEAD}\n    with:\n      a:\n        - b\n        - |", (*WITH, "a", 1), False, ""),
        (f"{HEAD} {{with: {{a: [b, c|", (*WITH, "a", 1), False, "c"),
        (f"{HEAD} {{with: {{a: ${{mat|", (*WITH, "a"), False, "${mat"),
    ],
)
def test_it_is_found(text: str, steps: Steps, is_key: bool, word: str) -> None:
    offset = text.index("|")
    found = cursor(text.replace("|", ""), offset)
    assert found
    assert (found.steps, found.is_key, found.word) == (steps, is_key, word)
    assert text[found.start : offset] == word


def test_there_is_no_value_directly_behind_a_colon() -> None:
    assert cursor(f"{HEAD} {{uses:", len(HEAD) + 7) is None


def test_it_knows_what_stands_before() -> None:
    found = cursor(f"{HEAD} {{uses: a, with: {{x: 1 m, y: 2 ", len(HEAD) + 33)
    assert found
    assert found.before == "2"
    assert found.values[("environment", "camera", "uses")] == "a"
    assert found.values[(*WITH, "x")] == "1 m"


@given(st.integers(0, len(SPEC)), st.text(st.sampled_from("a:{[]} -\n&*!|>\"'#\0\t🚗"), max_size=6))
def test_any_text_is_read(offset: int, typed: str) -> None:
    found = cursor(SPEC[:offset] + typed, offset + len(typed))
    assert found is None or (SPEC[:offset] + typed)[found.start :] == found.word
