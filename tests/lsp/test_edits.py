"""Rename and quick fixes, as an editor asks for them and applies them."""

from pathlib import Path
from typing import Any

import pytest

from tests.lsp.conftest import LONGER, SPEC, Repository
from tests.lsp.editor import Editor
from tests.lsp.test_requests import position

VARIED = SPEC.replace(
    "environment:", "matrix: {'light': [0.5, 1]}\nvary: {light: {from: 1, to: 2}}\nenvironment:"
).replace("z: 9.5 cm", 'z: 9.5 cm, exposure: "${matrix.light}", pitch: "${vary.light} ", yaw: "ä ${matrix.light}"')


def edited(text: str, edits: list[dict[str, Any]]) -> str:
    """The text after an editor's edits, none of which goes beyond its line."""
    lines = text.split("\n")
    for edit in sorted(edits, key=lambda e: e["range"]["start"]["character"], reverse=True):
        start, end = edit["range"]["start"], edit["range"]["end"]
        assert start["line"] == end["line"]
        line = lines[start["line"]]
        lines[start["line"]] = line[: start["character"]] + edit["newText"] + line[end["character"] :]
    return "\n".join(lines)


def at(path: Path, text: str, word: str) -> dict[str, Any]:
    line, character = position(text, word)
    return {"textDocument": {"uri": path.as_uri()}, "position": {"line": line, "character": character}}


@pytest.mark.parametrize(
    ("written", "word", "new", "changes"),
    [
        (SPEC, "camera:", "eye", [("  camera:", "  eye:")]),
        (SPEC, "track: {uses", "judge-2", [("track: {uses", "judge-2: {uses")]),
        (VARIED, "light'", "sun", [("'light'", "'sun'"), ("matrix.light", "matrix.sun")]),
        (VARIED, "light: {from", "sun", [("light: {from", "sun: {from"), ("vary.light", "vary.sun")]),
    ],
)
@pytest.mark.thorough
def test_a_name_changes_in_the_whole_file(
    written: str, word: str, new: str, changes: list[tuple[str, str]], opened: Editor, repository: Repository
) -> None:
    opened.change(repository.spec, written)
    asked = at(repository.spec, written, word)
    place = opened.request("textDocument/prepareRename", asked)
    assert edited(written, [{"range": place, "newText": ""}]) == written.replace(
        word, word.lstrip("abcdefghijklmnopqrstuvwxyz"), 1
    )
    answer = opened.request("textDocument/rename", {**asked, "newName": new})
    expected = written
    for before, after in changes:
        expected = expected.replace(before, after)
    assert edited(written, answer["changes"][repository.spec.as_uri()]) == expected != written


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("word", "new", "why"),
    [
        ("pose:", "Pose", "'Pose' is not a name, expected lower-case"),
        ("pose:", "vehicle", "'action' has 'vehicle' already"),
        ("integrator", "x", "only services of this file"),
        ("timeout", "x", "only services of this file"),
    ],
)
def test_a_rename_is_refused(word: str, new: str, why: str, opened: Editor, repository: Repository) -> None:
    asked = {**at(repository.spec, SPEC, word), "newName": new}
    assert opened.refusal("textDocument/rename", asked).startswith(why)


def test_a_service_of_an_extended_test_keeps_its_name(opened: Editor, repository: Repository) -> None:
    opened.open(repository.longer)
    assert opened.request("textDocument/prepareRename", at(repository.longer, LONGER, "track:")) is None
    opened.close(repository.longer)


def actions(editor: Editor, path: Path, problem: dict[str, Any], *only: str) -> list[dict[str, Any]]:
    context = {"diagnostics": [problem], **({"only": list(only)} if only else {})}
    asked = {"textDocument": {"uri": path.as_uri()}, "range": problem["range"], "context": context}
    found: list[dict[str, Any]] = editor.request("textDocument/codeAction", asked)
    return found


@pytest.mark.parametrize(
    ("before", "after"), [("freq: 10 Hz", "freqq: 10 Hz"), ("uses: collision", "uses: colision"), ("level:", "levl:")]
)
@pytest.mark.thorough
def test_a_quick_fix_mends_what_is_wrong(before: str, after: str, opened: Editor, repository: Repository) -> None:
    broken = SPEC.replace(before, after)
    (problem,) = opened.change(repository.spec, broken)
    (action,) = actions(opened, repository.spec, problem)
    assert (action["kind"], action["isPreferred"], action["diagnostics"]) == ("quickfix", True, [problem])
    assert edited(broken, action["edit"]["changes"][repository.spec.as_uri()]) == SPEC
    assert actions(opened, repository.spec, problem, "refactor") == []
    assert actions(opened, repository.spec, problem, "quickfix") == [action]


@pytest.mark.thorough
def test_no_quick_fix_without_one_way(opened: Editor, repository: Repository) -> None:
    (problem,) = opened.change(repository.spec, SPEC.replace("uses: collision", "uses: something"))
    assert actions(opened, repository.spec, problem) == []


@pytest.mark.thorough
def test_no_quick_fix_for_a_text_that_has_changed(opened: Editor, repository: Repository) -> None:
    (problem,) = opened.change(repository.spec, SPEC.replace("uses: collision", "uses: colision"))
    opened.type(repository.spec, SPEC)
    assert actions(opened, repository.spec, problem) == []
