"""The files that a test needs."""

from pathlib import Path

import pytest

from dodo_dsl.check import needed_files
from dodo_dsl.check.needed_files import check_needed_files, files
from tests.check.contexts import found


@pytest.fixture
def root(tmp_path: Path) -> Path:
    folder = tmp_path / "registry"
    for name in ("map/map.json", "map/sub/a.png", "map/.git/x", "map/__pycache__/y.pyc", "other.csv"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("x" * 11)
    (folder / "map/link.csv").symlink_to(folder / "other.csv")
    return folder


def test_a_file_and_a_folder_with_links_within_the_registry(root: Path) -> None:
    assert files(root / "other.csv", root) == {"other.csv": root / "other.csv"}
    assert files(root / "map", root) == {
        "map/link.csv": root / "other.csv",
        "map/map.json": root / "map/map.json",
        "map/sub/a.png": root / "map/sub/a.png",
    }


@pytest.mark.parametrize(("limit", "path"), [("MAX_FILES", "map"), ("MAX_BYTES", "other.csv")])
def test_too_much(limit: str, path: str, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(needed_files, limit, 1)
    assert "holds more than" in files(root / path, root)


def test_a_map_is_needed_with_its_folder_in_which_no_link_leaves_the_registry(tmp_path: Path) -> None:
    (tmp_path / "secret").touch()
    (tmp_path / "tests/maps/plain").mkdir(parents=True)
    (tmp_path / "tests/maps/plain/link").symlink_to(tmp_path / "secret")
    camera = "environment:\n  camera: {uses: virtual-camera, with: {map-path: ../maps/plain/map.json}}\n"
    expected = [("path-escape", "'maps/plain/link' is a symbolic link that leaves the registry")]
    assert found(check_needed_files, camera, tmp_path) == expected
