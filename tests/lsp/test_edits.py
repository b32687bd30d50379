"""Quick fixes, as an editor asks for them and applies them."""

from pathlib import Path
from typing import Any

import pytest

from tests.lsp.conftest import SPEC, Repository
from tests.lsp.editor import Editor


def edited(text: str, edits: list[dict[str, Any]]) -> str:
    """The text after an editor's edits, none of which goes beyond its line."""
    lines = text.split("\n")
    for edit in sorted(edits, key=lambda e: e["range"]["start"]["character"], reverse=True):
        start, end = edit["range"]["start"], edit["range"]["end"]
        assert start["line"] == end["line"]
        line = lines[start["line"]]
        lines[start["line"]] = line[: start["character"]] + edit["newText"] + line[end["character"] :]
    return "\n".join(lines)


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
