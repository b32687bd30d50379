"""Names of tests, and the hints about them."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.compiler import load
from dodo_dsl.source import resolve
from dodo_dsl.spec.registry import KEYWORDS, is_free, near
from tests.check import examples

NAMING = ("wrong-type", "wrong-value", "missing-key", "name-differs", "name-reserved")


@given(st.text(max_size=80) | st.sampled_from(sorted(KEYWORDS)) | st.from_regex(r"[a-z-]{0,80}", fullmatch=True))
@pytest.mark.thorough
def test_a_near_name_is_a_name(text: str) -> None:
    assert is_free(near(text))
    assert near(text) == text or not is_free(text)


@pytest.mark.parametrize("stem", ["a-test", "true", "My_Test", "12", "null", "cache", "x" * 70])
@pytest.mark.parametrize("name", ["true", "12", '"true"', "My_Test", "~", "other", "cache"])
def test_a_test_has_a_good_name_when_it_does_what_the_hint_says(tmp_path: Path, stem: str, name: str) -> None:
    examples.write("", tmp_path)
    text = (tmp_path / examples.EXAMPLE).read_text()
    hint = _hint(tmp_path / f"tests/{stem}.dodo.yml", text, name)
    if renamed := re.search(r"rename the file to ([^ ,]+)\.dodo\.yml", hint):
        stem = renamed[1]
    if written := re.search(r"write 'name: ([^']+)'", hint):
        name, stem = written[1], stem if "or rename" not in hint else written[1]
    assert _hint(tmp_path / f"tests/{stem}.dodo.yml", text, name) == ""
    assert resolve(name) == name


def _hint(path: Path, text: str, name: str) -> str:
    """What is told to write as the name of a test of this name in this file; empty where nothing is wrong."""
    path.write_text(text.replace("name: example", f"name: {name}", 1))
    found = [d for d in load([path], start=path.parent).diagnostics if d.rule in NAMING and d.span.line <= 2]
    path.unlink()
    assert len(found) <= 1, found
    return found[0].hint if found else ""
