"""The output folder: whether it is stale, how it differs, and which folders in it are DoDo's own."""

import os
import shutil
from pathlib import Path

import pytest

from tests.emit.readers import run, tree

CURVE, STRAIGHT = "sil-closed-left-curve", "sil-closed-straight"


@pytest.fixture
def output(generated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the compiled registry, in a copy of its checkout that is the working folder."""
    shutil.copytree(generated.parent, tmp_path / "checkout")
    monkeypatch.chdir(tmp_path / "checkout")
    return tmp_path / "checkout" / "generated"


def count(output: Path) -> int:
    return len(list(output.glob("*/test.json")))


def test_check_says_when_output_is_stale(output: Path) -> None:
    assert run("compile", "--check")[0] == 0
    layer = output / STRAIGHT / "action.compose.yml"
    before = layer.read_text()
    layer.write_text(before.replace("init: true", "init: false"))
    code, out, _ = run("compile", "--check")
    assert code == 1
    assert "-    init: false\n+    init: true\n" in out
    assert layer.read_text() != before
    assert run("compile")[0] == 0
    assert layer.read_text() == before


def test_a_long_difference_is_shown_with_diff_only(output: Path) -> None:
    before = tree(output)
    for name in (CURVE, STRAIGHT):
        (output / name / "action.compose.yml").write_text("# of somebody else\n" * 50)
    (output / "dil-kiwi-track/.env").unlink()
    code, out, _ = run("compile", "--check")
    state = f"{count(output)} tests checked: generated is stale; dodo compile brings it up to date\n"
    assert (code, out) == (1, f"stale in generated: dil-kiwi-track, {CURVE}, {STRAIGHT}; --diff shows how\n{state}")
    code, out, _ = run("compile", "--check", "--diff")
    assert (code, out.count("-# of somebody else\n")) == (1, 100)
    assert out.endswith(state)
    assert run("compile")[0] == 0
    assert tree(output) == before


@pytest.mark.slow
def test_stale_tests_leave_the_output(output: Path) -> None:
    (output / "mine").mkdir()
    (output / "mine" / "notes.txt").write_text("keep")
    others = count(output) - 1
    code, out, _ = run("compile", STRAIGHT)
    first, second = out.splitlines()
    assert (code, first) == (0, "1 test compiled into generated")
    assert second.startswith(f"removed {others} ")
    assert ": dil-kiwi-track, " in second
    assert second.endswith(f" and {others - 8} more")
    assert sorted(p.name for p in output.iterdir() if p.is_dir()) == ["mine", STRAIGHT]
    assert (output / "mine" / "notes.txt").exists()
    assert run("compile")[0] == 0
    assert (output / CURVE).is_dir()


def test_files_of_a_test_are_readable_for_users_of_containers(
    generated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the umask, which closes the folder around them."""
    monkeypatch.chdir(generated.parent)
    before = os.umask(0o077)
    try:
        assert run("compile", STRAIGHT, "-o", str(tmp_path / "out"))[0] == 0
    finally:
        os.umask(before)
    test = tmp_path / "out" / STRAIGHT
    assert oct(test.stat().st_mode & 0o777) == "0o700"
    files = [test / "files", *(test / "files").rglob("*")]
    assert len(files) > 3
    assert {oct(path.stat().st_mode & 0o077) for path in files} == {"0o55", "0o44"}
