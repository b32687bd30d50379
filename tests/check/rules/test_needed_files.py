"""The files that a test needs."""

from pathlib import Path

import pytest

from dodo_dsl.check import file_rules
from dodo_dsl.check.file_rules import files


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
    monkeypatch.setattr(file_rules, limit, 1)
    assert "holds more than" in files(root / path, root)
