"""The commonest slips of YAML: what is said about each, once and at the line that is wrong."""

import json
import shutil
import string
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.source import parse
from tests.emit.readers import run
from tests.slips.wrong import SLIPS

FOLDER = Path(__file__).parent
GOOD = (FOLDER / "good.dodo.yml").read_text()
Said = dict[str, list[dict[str, str]]]


def written(name: str) -> str:
    """The good test with one slip, whose name it has."""
    lines = [line.replace("name: good", f"name: {name}") for line in GOOD.splitlines()]
    changed = [SLIPS[name][0].get(number, line) for number, line in enumerate(lines, 1)]
    text = "".join(f"{line}\n" for line in changed if line is not None)
    return text.replace("\n", "\r\n") if name.startswith("crlf") else text


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Said:
    """What ``dodo compile --check`` says of all slips together: the diagnostics of each."""
    folder = tmp_path_factory.mktemp("slips")
    shutil.copytree(FOLDER / "maps", folder / "maps")
    for name in SLIPS:
        (folder / f"{name}.dodo.yml").write_bytes(written(name).encode())
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [.]\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, out, err = run("compile", "--check", "--format", "json", ".")
    assert (code, err) == (2, "")
    found: Said = {}
    for said in json.loads(out):
        found.setdefault(said["file"].removesuffix(".dodo.yml"), []).append(said)
    return found


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_is_told_once(name: str, told: Said) -> None:
    (said,) = told[name]
    assert f"{said['line']}:{said['column']} {said['rule']}" == SLIPS[name][1]
    assert said["hint"]


def test_patterns_are_not_tried_on_lines_as_long_as_a_file() -> None:
    """Some would take minutes for what strangers write."""
    messages = [parse(f"a: {'x ' * words}y: z", "long.yml")[1][0].message for words in (100, 100_000)]
    assert messages[0].startswith("a second colon") and messages[1].startswith("not YAML")


CHARACTERS = "\t \n:-{}[]'\",#&*!|>%@`=;\u00a0" + string.ascii_lowercase[:3]


@settings(deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.integers(0, 3), st.text(CHARACTERS, max_size=3))
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
