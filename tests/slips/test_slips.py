"""The commonest slips of YAML: each has a file and what is said about it, once and at the line that is wrong.

A file is the good test with one slip. ``pytest --update-goldens`` writes what is said.
"""

import re
import shutil
import string
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.source import parse
from tests.emit.readers import run

FOLDER = Path(__file__).parent / "bad"
SLIPS = sorted(path.name.removesuffix(".dodo.yml") for path in FOLDER.glob("*.dodo.yml"))
GOOD = (Path(__file__).parent / "good.dodo.yml").read_text()


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """What ``dodo compile --check`` says of all slips together: the diagnostics of each."""
    folder = tmp_path_factory.mktemp("slips")
    shutil.copytree(FOLDER.parent / "maps", folder / "maps")
    for path in FOLDER.glob("*.dodo.yml"):
        shutil.copy(path, folder)
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [.]\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, out, err = run("compile", "--check", ".")
    assert (code, err) == (2, "")
    found: dict[str, list[str]] = {}
    for said in re.split(
        r"^(?=\S+: (?:error|warning)\[)", out.removesuffix("dodo explain RULE says more\n"), flags=re.M
    ):
        found.setdefault(said.partition(".dodo.yml:")[0], []).append(said)
    return found


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_is_told_once(name: str, told: dict[str, list[str]], update_goldens: bool) -> None:
    expected = FOLDER / f"{name}.out"
    if update_goldens:
        expected.write_text("".join(told[name]))
    (said,) = told[name]
    assert said == expected.read_text()
    assert "not YAML" not in said
    assert "\n  hint: " in said


@pytest.mark.parametrize("name", SLIPS)
def test_it_is_told_at_the_line_that_is_wrong(name: str) -> None:
    """A line that the good test does not have."""
    lines = (FOLDER / f"{name}.dodo.yml").read_bytes().decode().splitlines()
    place = re.match(r"\S+:(\d+):\d+: ", (FOLDER / f"{name}.out").read_text())
    assert place is not None
    assert lines[int(place[1]) - 1] not in GOOD.splitlines()


@pytest.mark.parametrize(
    "name",
    [
        "alias-misspelt",
        "block-above-colon",
        "block-above-percent",
        "char-byte-order-mark",
        "char-nbsp",
        "char-percent-share",
        "colon-full-width",
        "colon-semicolon",
        "list-dash-no-blank-second",
        "list-dash-other",
    ],
)
def test_its_fix_makes_it_yaml(name: str) -> None:
    text = (FOLDER / f"{name}.dodo.yml").read_text()
    _, (problem,) = parse(text, name)
    assert problem.fix is not None
    lines, at = text.split("\n"), problem.span
    line, start, end = lines[at.line - 1], at.column - 1, at.column - 1 + at.length
    lines[at.line - 1] = line[:start] + problem.fix.mended(line[start:end]) + line[end:]
    assert parse("\n".join(lines), name)[1] == []


def test_there_are_more_than_thirty() -> None:
    assert len(SLIPS) > 30
    assert sorted(path.stem for path in FOLDER.glob("*.out")) == SLIPS


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_lines_of_any_system_are_fine(ends: str) -> None:
    node, problems = parse(GOOD.replace("\n", ends), "good.dodo.yml")
    assert (node is None, problems) == (False, [])


CHARACTERS = "\t \n:-{}[]'\",#&*!|>%@`=;\u00a0" + string.ascii_lowercase[:3]


@settings(max_examples=100, deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.integers(0, 3), st.text(CHARACTERS, max_size=3))
@pytest.mark.thorough
def test_no_change_of_a_few_characters_is_more_than_a_sentence(place: int, gone: int, new: str) -> None:
    """Whatever is typed, there is a file or a place within it, and a message of one line."""
    text = GOOD[:place] + new + GOOD[place + gone :]
    node, problems = parse(text, "changed.dodo.yml")
    assert node is not None or problems or not text.strip()
    for problem in problems:
        assert problem.message
        assert "\n" not in problem.message + problem.hint
        assert 1 <= problem.span.line <= text.count("\n") + 2
        assert problem.span.column >= 1
