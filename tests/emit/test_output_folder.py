"""The output folder: whether it is stale, how it differs, and which folders in it are DoDo's own."""

import os
import shutil
from pathlib import Path

import pytest

from dodo_dsl.plan import test_files
from dodo_dsl.plan.test_files import SHARED
from tests.emit.readers import ROOT, run, tree

CURVE, STRAIGHT = "sil-closed-left-curve", "sil-closed-straight"


@pytest.fixture
def output(generated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the compiled registry, in a copy of its checkout that is the working folder."""
    shutil.copytree(generated.parent, tmp_path / "checkout")
    monkeypatch.chdir(tmp_path / "checkout")
    return tmp_path / "checkout" / "generated"


def count(output: Path) -> int:
    return len(list(output.glob("*/test.json")))


@pytest.mark.thorough
def test_check_says_when_output_is_stale(output: Path) -> None:
    assert run("compile", "--check")[0] == 0
    layer = output / STRAIGHT / "action.compose.yml"
    before = layer.read_text()
    layer.write_text(before.replace("init: true", "init: false"))
    code, out, _ = run("compile", "--check")
    assert code == 1
    assert "-  init: false\n+  init: true\n" in out
    assert layer.read_text() != before
    assert run("compile")[0] == 0
    assert layer.read_text() == before


@pytest.mark.thorough
def test_a_long_difference_is_cut(output: Path) -> None:
    before = tree(output)
    for name in (CURVE, STRAIGHT):
        (output / name / "action.compose.yml").write_text("# of somebody else\n" * 50)
    (output / "dil-kiwi-track/.env").unlink()
    code, out, _ = run("compile", "--check")
    state = f"{count(output)} tests checked: generated is stale; dodo compile brings it up to date\n"
    assert (code, out.count("\n")) == (1, 102)
    assert "more lines\n" in out and out.endswith(state)
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
    assert sorted(p.name for p in output.iterdir() if p.is_dir()) == ["mine", STRAIGHT]
    assert (output / "mine" / "notes.txt").exists()
    assert run("compile")[0] == 0
    assert (output / CURVE).is_dir()


@pytest.mark.thorough
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


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The output folder of two tests that share the files of one map, all of which count as large."""
    shutil.copytree(ROOT / "tests_registry" / STRAIGHT, tmp_path / "registry" / STRAIGHT)
    for name in ("maps", "vehicles"):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / "registry" / name)
    spec = "dodo: 1\nname: sil-b\nextends: ../sil-closed-straight/sil-closed-straight.dodo.yml\n"
    (tmp_path / "registry/sil-b").mkdir()
    (tmp_path / "registry/sil-b/sil-b.dodo.yml").write_text(spec)
    application = f"application: {ROOT}/examples/kiwi/docker-compose.yml\n"
    (tmp_path / "dodo.yml").write_text(f"dodo: 1\nregistry: [registry]\n{application}")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(test_files, "LARGE", 1)
    return tmp_path / "generated"


def links(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_symlink()]


@pytest.mark.thorough
def test_files_that_tests_share_stand_once(pair: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each path of a test opens the file as before, and a compilation with fewer tests brings the copies back."""
    assert run("compile")[0] == 0
    shared = {path.relative_to(pair / "sil-b/files").as_posix(): path.read_bytes() for path in links(pair / "sil-b")}
    assert "maps/straight/map.json" in shared
    assert len({path.stat().st_ino for path in links(pair)}) == len(list((pair / SHARED).iterdir())) <= len(shared)
    first = tree(pair)
    assert [run("compile", "--check")[:2], run("compile")[0]] == [(0, "2 tests checked: no problems\n"), 0]
    assert tree(pair) == first
    assert run("compile", "sil-b")[0] == 0
    assert (links(pair), (pair / SHARED).exists()) == ([], False)
    assert {name: (pair / "sil-b/files" / name).read_bytes() for name in shared} == shared
    alone = tree(pair)
    assert run("compile")[0] == 0 and tree(pair) == first
    (next((pair / SHARED).iterdir())).write_text("other")
    (pair / SHARED / f"{'0' * 64}-old.rec").touch()
    code, out, _ = run("compile", "--check")
    assert code == 1 and f"differs: {SHARED}/" in out and f"no longer needed: {SHARED}/000" in out
    monkeypatch.setattr(test_files, "LARGE", 1 << 20)
    assert run("compile", "sil-b")[0] == 0 and tree(pair) == alone


@pytest.mark.thorough
def test_nothing_is_written_through_links_that_look_like_shared_files(pair: Path, tmp_path: Path) -> None:
    """A repository may hold its output, with links that lead elsewhere."""
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs/map.json").write_text("untouched")
    assert run("compile")[0] == 0
    wanted = tree(pair)
    for path in (pair / SHARED).iterdir():
        path.unlink()
        path.symlink_to(tmp_path / "theirs/map.json")
    name = f"{'0' * 64}-straight"
    (pair / SHARED / name).symlink_to(tmp_path / "theirs")
    shutil.rmtree(pair / "sil-b/files/maps/straight")
    (pair / "sil-b/files/maps/straight").symlink_to(f"../../../{SHARED}/{name}")
    assert run("compile")[0] == 0
    assert tree(pair) == wanted
    assert tree(tmp_path / "theirs") == {"map.json": b"untouched"}
    shutil.rmtree(pair / SHARED)
    (pair / SHARED).symlink_to(tmp_path / "theirs")
    code, _, err = run("compile")
    assert code == 2 and "a symlink, which no output follows" in err


def test_a_folder_of_others_is_not_replaced(pair: Path, tmp_path: Path) -> None:
    before = tree(tmp_path)
    code, _, err = run("compile", "-o", "registry")
    assert code == 2 and "no compiled test; name another folder with --output" in err
    assert (tree(tmp_path), pair.exists()) == (before, False)
