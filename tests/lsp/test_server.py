"""The language server as an editor sees it: on each save, what ``dodo compile --check`` finds."""

import json
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from tests.lsp.conftest import COMPOSE, LONGER, SPEC, Repository
from tests.lsp.editor import PATIENCE_S, Editor, editor

BROKEN = {
    "unit": SPEC.replace("10 Hz", "10"),
    "wiring": SPEC.replace("  vehicle: {uses: dynamic-model}\n", ""),
    "name": SPEC.replace("name: sil-my-straight", "name: sil-longer"),
    "warning": SPEC.replace("max-time: 40 s", "max-time: 60 s"),
    "yaml": SPEC.replace("walls: [left, right]", "walls: [left, right"),
    "empty": "",
    "wide": SPEC.replace("dynamic-model}", "dynamic-model, with: {🚗🚗: 1, frequ: 1}}"),
    "nul": "\0",
    "alias": "a: &a [*a]",
    "deep": "{" * 9000,
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
@pytest.mark.thorough
def test_a_save_shows_what_a_check_finds(
    text: str, opened: Editor, repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(repository.folder)
    shown = opened.save(repository.spec, text)
    stdout = StringIO()
    assert main(["compile", "--check", "--format", "json"], stdout, StringIO()) in (0, 2)
    own = str(repository.spec.relative_to(repository.folder))
    rows = [row for row in json.loads(stdout.getvalue()) if row["file"] == own]
    expected = sorted((row["rule"], row["line"], f"{row['message']}\n{row['hint']}".rstrip()) for row in rows)
    assert shown
    assert sorted((p["code"], p["range"]["start"]["line"] + 1, p["message"]) for p in shown) == expected
    assert {p["severity"] for p in shown} == {1 if row["severity"] == "error" else 2 for row in rows}
    assert opened.save(repository.spec, SPEC) == []


def test_columns_are_in_utf_16(opened: Editor, repository: Repository) -> None:
    """Two cars of two code units each stand before the wrong value."""
    shown = opened.save(repository.spec, BROKEN["wide"])
    column = BROKEN["wide"].splitlines()[10].index("frequ") + 2
    (place,) = [p["range"] for p in shown if "'frequ'" in p["message"]]
    assert place == {"start": {"line": 10, "character": column}, "end": {"line": 10, "character": column + 5}}
    assert opened.save(repository.spec, SPEC) == []


def test_problems_of_other_files_are_shown_there_and_go(opened: Editor, repository: Repository) -> None:
    opened.save(repository.spec, SPEC.replace("  track: {uses", "  lane: {uses"))
    assert "missing-key" in {p["code"] for p in opened.problems(repository.longer)}
    opened.save(repository.spec, SPEC)
    assert opened.shown[repository.longer.as_uri()] == []
    compose = repository.folder / "docker-compose.yml"
    compose.write_text(COMPOSE.replace("steering:", "camera:"))
    opened.notify("didSave", compose)
    assert [p["code"] for p in opened.problems(repository.spec)] == ["name-taken"]
    compose.write_text(COMPOSE)


def test_a_test_outside_all_deployments_is_checked(repository: Repository, tmp_path: Path) -> None:
    path = tmp_path.resolve() / "sil-alone.dodo.yml"
    path.write_text(LONGER)
    with editor(repository.folder) as one:
        assert {"path-escape", "name-differs"} <= {p["code"] for p in one.open(path)}
        one.notify("didClose", path)
        assert one.problems(path) == []
        assert one.leave() == 0


def test_the_server_ends_with_the_editor(repository: Repository) -> None:
    with editor(repository.folder) as one:
        assert one.process.stdin
        assert one.process.stderr
        one.process.stdin.close()
        assert one.process.wait(PATIENCE_S) == 0
        assert one.process.stderr.read() == b""


def test_on_a_terminal_it_says_who_starts_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", None)
    stderr = StringIO()
    assert main(["lsp"], StringIO(), stderr) == 2
    assert "an editor starts this program" in stderr.getvalue()
