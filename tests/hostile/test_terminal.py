"""Text of others says what it says, and commands neither a terminal nor the log of CI."""

import json
import re
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.terminal import harmless_stream, printable
from tests.hostile.command import dodo

ATTACKS = {
    "title": "\x1b]0;owned\x07",
    "colour": "\x1b[31mred",
    "c1": "\x9b31m",
    "bell": "\a",
    "carriage return": "passed\r",
    "right to left": "\u202egnp.exe",
    "github": "\n::error::you failed",
    "github behind blanks": "\n  ::set-output name=a::b",
    "github of old": "##[error]you failed",
    "azure": "##vso[task.complete result=Succeeded;]",
    "gitlab": "\nsection_start:1:a[collapsed=true]\r\x1b[0K",
    "verdict": "\n1 passed, 0 failed, 0 in error",
}
FORBIDDEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]|^\s*::|##\[|##vso\[|^1 passed", re.MULTILINE)


ALL = "".join(ATTACKS.values())


@pytest.mark.parametrize("attack", ATTACKS)
def test_no_text_commands_a_stream(attack: str) -> None:
    """No text that DoDo prints commands a terminal or a log."""
    stream = StringIO()
    out = harmless_stream(stream)
    assert harmless_stream(out) is out
    for part in (ATTACKS[attack], "\n", ATTACKS[attack][1:], "\nend\n"):
        out.write(part)
    assert not FORBIDDEN.search(stream.getvalue().replace("\n1 passed", "\n")), repr(stream.getvalue())
    assert stream.getvalue().endswith("\nend\n")
    assert not FORBIDDEN.search(printable("x" + ATTACKS[attack]).replace("##", ""))


PIECES = st.sampled_from(["#", "##", "[", "##[", "vso", "vso[", ":", "::", "::error::", " ", "\t", "\n", "a", "\x1b["])


@given(st.lists(PIECES | st.text(max_size=5), max_size=12))
@pytest.mark.thorough
def test_no_pieces_become_a_command(pieces: list[str]) -> None:
    """No pieces of text become a command together (property test)."""
    stream = StringIO()
    out = harmless_stream(stream)
    for piece in pieces:
        assert out.write(piece) == len(piece)
    assert not re.search(r"^[ \t]*::|##\[|##vso\[", stream.getvalue(), re.MULTILINE), repr(stream.getvalue())
    assert all(c.isprintable() or c in "\n\t" for c in stream.getvalue())


@pytest.mark.thorough
@pytest.mark.parametrize("place", ["name", "description", "rig", "service", "file"])
def test_a_repository_commands_no_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    monkeypatch.chdir(tmp_path)
    text = json.dumps(ALL + "x")
    spec = {"name": "a", "description": "b", "level": "sil", "kind": "closed-loop", "timeout": "1 s"}
    written = {key: json.dumps(value) for key, value in spec.items()}
    folder = tmp_path / "tests" / "a"
    if place in written:
        written[place] = text
    (tmp_path / "dodo.yml").write_text(
        f"dodo: 1\nregistry: [tests]\n{f'rigs: {{{text}: 3}}' if place == 'rig' else ''}\n"
    )
    folder.mkdir(parents=True)
    body = "".join(f"{key}: {value}\n" for key, value in written.items())
    uses = text if place == "service" else "collision"
    (folder / "a.dodo.yml").write_text(f"dodo: 1\n{body}evaluation: {{{text}: {{uses: {uses}}}}}\n")
    if place == "file":
        (folder / f"{ALL.replace('/', '')}.dodo.yml").write_text("dodo: 1\n")
    for words in (("list",), ("compile", "--check"), ("explain", "a"), ("rig", "status")):
        _, output = dodo(*words)
        assert "internal error" not in output, output
        assert not FORBIDDEN.search(output), repr(output)
