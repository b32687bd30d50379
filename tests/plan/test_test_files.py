"""Files that are copied beside a compiled test."""

from pathlib import Path

import pytest

from dodo_dsl.plan import test_files
from dodo_dsl.plan.test_files import FileCopy, FilesError, copies


@pytest.fixture
def root(tmp_path: Path) -> Path:
    folder = tmp_path / "registry"
    for name in ("map/map.json", "map/sub/a.png", "map/.git/x", "map/__pycache__/y.pyc", "other.csv"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


def test_a_file_and_a_folder(root: Path) -> None:
    assert copies(root / "other.csv", root) == [FileCopy("other.csv", root / "other.csv")]
    assert copies(root / "map", root) == [
        FileCopy("map/map.json", root / "map/map.json"),
        FileCopy("map/sub/a.png", root / "map/sub/a.png"),
    ]


def test_symlinks_within_the_registry(root: Path) -> None:
    (root / "map/link.csv").symlink_to(root / "other.csv")
    assert FileCopy("map/link.csv", root / "other.csv") in copies(root / "map", root)


def test_symlinks_out_of_it(root: Path) -> None:
    (root.parent / "secret").touch()
    (root / "map/link").symlink_to(root.parent / "secret")
    with pytest.raises(FilesError, match="'map/link' is a symbolic link that leaves the registry"):
        copies(root / "map", root)


def test_too_many_files(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_files, "MAX_FILES", 1)
    with pytest.raises(FilesError, match="'map' holds more than 1 files or 2 GiB"):
        copies(root / "map", root)


def test_too_many_bytes(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (root / "other.csv").write_text("x" * 11)
    monkeypatch.setattr(test_files, "MAX_BYTES", 10)
    with pytest.raises(FilesError, match=r"'other\.csv' holds more than"):
        copies(root / "other.csv", root)
