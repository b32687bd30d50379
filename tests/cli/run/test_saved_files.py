"""Files that are saved below folders."""

import os
from pathlib import Path

import pytest

from dodo_dsl.cli import watch
from dodo_dsl.cli.watch import saved, seen


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.py", "tests/b.yml", "report/c.json", ".git/d", "__pycache__/e.pyc", "f.py~", "tests/.g.swp"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("text")
    return tmp_path


def names(folder: Path, paths: "set[Path] | dict[Path, tuple[int, int]]") -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def test_hidden_files_and_outputs_are_left_out(folder: Path) -> None:
    assert names(folder, seen([folder], {folder / "report"})) == ["a.py", "tests/b.yml"]


def test_what_is_written_replaced_made_or_removed_is_saved(folder: Path) -> None:
    before = seen([folder], ())
    assert saved(before, seen([folder], ())) == set()
    os.utime(folder / "a.py", ns=(1, 1))
    (folder / "tests" / "b.yml").unlink()
    (folder / "tests" / "new.yml").write_text("text")
    assert names(folder, saved(before, seen([folder], ()))) == ["a.py", "tests/b.yml", "tests/new.yml"]


def test_links_lead_into_no_other_folder_and_a_missing_folder_is_empty(folder: Path) -> None:
    (folder / "tests" / "up").symlink_to(folder)
    (folder / "dangling").symlink_to("nowhere")
    assert names(folder, seen([folder / "tests", folder / "nowhere"], ())) == ["tests/b.yml"]


def test_no_more_files_than_can_be_looked_at(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch, "MOST_FILES", 1)
    assert names(folder, seen([folder], ())) == ["a.py"]
