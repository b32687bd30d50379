"""The language server as an editor sees it."""

import asyncio
import io
import json
import sys
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl import advice
from dodo_dsl.cli.main import main
from dodo_dsl.lsp import server
from tests.lsp.conftest import LONGER, SPEC, Repository
from tests.lsp.editor import PATIENCE_S, Editor, Message, editor

BROKEN = {
    "unit": SPEC.replace("10 Hz", "10"),
    "parameter": SPEC.replace("max-time:", "max-tiem:"),
    "service": SPEC.replace("uses: integrator", "uses: integrater"),
    "wiring": SPEC.replace("  vehicle: {uses: dynamic-model}\n", ""),
    "map": SPEC.replace("goal: finish", "goal: end"),
    "name": SPEC.replace("name: sil-my-straight", "name: sil-longer"),
    "schema": SPEC.replace("level: sil", "level: sli"),
    "yaml": SPEC.replace("walls: [left, right]", "walls: [left, right"),
    "empty": "",
    "list": "- 1\n",
    "wide": SPEC.replace("map-path:", "colour: 🚗🚗, map-path:"),
}


def places(problems: list[Message]) -> list[tuple[str, int, int]]:
    starts = ((p["code"], p["range"]["start"]) for p in problems)
    return sorted((rule, start["line"] + 1, start["character"] + 1) for rule, start in starts)


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
@pytest.mark.thorough
def test_an_unsaved_text_has_the_problems_of_a_file(
    text: str, opened: Editor, repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = opened.change(repository.spec, text)
    assert repository.spec.read_text() == SPEC
    stdout = StringIO()
    monkeypatch.chdir(repository.folder)
    repository.spec.write_text(text)
    try:
        assert main(["compile", "--check", "--format", "json"], stdout, StringIO()) == 2
    finally:
        repository.spec.write_text(SPEC)
    own = str(repository.spec.relative_to(repository.folder))
    rows = [row for row in json.loads(stdout.getvalue()) if row["file"] == own]
    assert shown
    assert places(shown) == sorted((row["rule"], row["line"], row["column"]) for row in rows)
    assert {p["message"] for p in shown} == {f"{r['message']}\n{r['hint']}".rstrip() for r in rows}
    assert opened.change(repository.spec, SPEC) == []


@pytest.mark.thorough
def test_a_problem_has_rule_range_severity_and_hint(opened: Editor, repository: Repository) -> None:
    (shown,) = opened.change(repository.spec, BROKEN["unit"])
    start = SPEC.splitlines()[8].index("10 Hz")
    assert shown == {
        "range": {"start": {"line": 8, "character": start}, "end": {"line": 8, "character": start + 2}},
        "message": "parameter 'freq': '10' has no unit, expected a frequency in Hz\nwrite for example '10 Hz'",
        "severity": 1,
        "code": "wrong-unit",
        "source": "dodo",
    }
    (shown,) = opened.change(repository.spec, SPEC.replace("max-time: 40 s", "max-time: 60 s"))
    assert (shown["code"], shown["severity"]) == ("short-timeout", 2)


def test_columns_are_in_utf_16(opened: Editor, repository: Repository) -> None:
    """Two cars of two code units each stand before the wrong value."""
    text = SPEC.replace("dynamic-model}", "dynamic-model, with: {🚗🚗: 1, frequ: 1}}")
    shown = opened.change(repository.spec, text)
    line = text.splitlines()[10]
    (place,) = [p["range"] for p in shown if "'frequ'" in p["message"]]
    assert place["start"] == {"line": 10, "character": line.index("frequ") + 2}
    assert place["end"] == {"line": 10, "character": line.index("frequ") + len("frequ") + 2}


@pytest.mark.thorough
def test_a_problem_of_another_file_is_shown_there(opened: Editor, repository: Repository) -> None:
    opened.type(repository.spec, SPEC.replace("  track: {uses", "  lane: {uses"))
    shown = opened.problems(repository.longer)
    assert {"missing-key"} <= {p["code"] for p in shown}
    opened.type(repository.spec, SPEC)
    assert opened.problems(repository.longer) == []


@pytest.mark.thorough
def test_the_deployment_is_checked_and_read_as_it_is_shown(opened: Editor, repository: Repository) -> None:
    text = repository.deployment.read_text()
    assert opened.open(repository.deployment) == []
    version = opened.type(repository.deployment, text.replace("docker-compose.yml", "compose.yml"))
    (shown,) = opened.problems(repository.deployment, version)
    assert (shown["code"], shown["range"]["start"]["line"]) == ("missing-file", 2)
    assert opened.change(repository.deployment, text) == []
    opened.close(repository.deployment)


@pytest.mark.thorough
def test_what_is_saved_elsewhere_counts_at_once(opened: Editor, repository: Repository) -> None:
    """A map that lost its finish, and a test that the other one extends."""
    before = repository.map.read_text()
    repository.map.write_text(before.replace('"finish"', '"start"'))
    saved = {"textDocument": {"uri": repository.map.as_uri()}}
    opened.send(method="textDocument/didSave", params=saved)
    assert [p["code"] for p in opened.problems(repository.spec)] == ["unknown-name"]
    repository.map.write_text(before)
    event = {"changes": [{"uri": repository.map.as_uri(), "type": 2}]}
    opened.send(method="workspace/didChangeWatchedFiles", params=event)
    assert opened.problems(repository.spec) == []


@pytest.mark.parametrize(
    "text", ["\0", "a: \ud83d", "\ufeffdodo: 1\n", "a: &a [*a]", "{" * 9000, "a: x\u2028b: {", "\t- a"]
)
@pytest.mark.thorough
def test_no_text_ends_the_server(text: str, opened: Editor, repository: Repository) -> None:
    assert opened.change(repository.spec, text)
    assert opened.change(repository.spec, SPEC) == []


def test_a_test_outside_all_deployments_is_checked(running: Editor, tmp_path: Path) -> None:
    path = tmp_path.resolve() / "sil-alone.dodo.yml"
    path.write_text(LONGER)
    found = running.open(path)
    assert {"path-escape", "name-differs"} <= {p["code"] for p in found}
    running.close(path)
    assert running.problems(path) == []


@pytest.mark.thorough
def test_a_client_may_count_in_code_points_and_leave(repository: Repository) -> None:
    with editor(repository.folder, ["utf-32"]) as one:
        text = SPEC.replace("dynamic-model}", "dynamic-model, with: {🚗🚗: 1, frequ: 1}}")
        places = [p["range"]["start"] for p in one.open(repository.spec, text) if "'frequ'" in p["message"]]
        assert places == [{"line": 10, "character": text.splitlines()[10].index("frequ")}]
        assert one.leave() == 0
        assert one.process.stderr
        assert one.process.stderr.read() == b""


@pytest.mark.thorough
def test_the_server_ends_with_the_editor(repository: Repository) -> None:
    with editor(repository.folder) as one:
        assert one.process.stdin
        assert one.process.stderr
        one.process.stdin.close()
        assert one.process.wait(PATIENCE_S) == 0
        assert one.process.stderr.read() == b""


def test_an_internal_error_is_a_message_of_the_log(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("out of luck")

    monkeypatch.setattr(server.Projects, "check", fail)
    written = io.BytesIO()

    async def check() -> None:
        one = server.build()
        one.protocol.set_writer(written)  # type: ignore[arg-type]
        monkeypatch.setattr(one.protocol, "_workspace", server_workspace())
        one._stale.set()
        await one._check()

    asyncio.run(check())
    assert b"window/logMessage" in written.getvalue()
    assert b"the check failed: RuntimeError: out of luck" in written.getvalue()
    assert b"Traceback" not in written.getvalue()


def server_workspace() -> object:
    from pygls.workspace import Workspace

    return Workspace(None)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ["pygls", *(name for name in sys.modules if name.startswith("pygls."))]:
        monkeypatch.setitem(sys.modules, name, None)
    stderr = StringIO()
    assert main(["lsp"], StringIO(), stderr) == 2
    assert stderr.getvalue() == f"dodo lsp: this needs pygls: {advice.install('lsp')}\n"
