"""Specs in registries and elsewhere."""

from pathlib import Path

import pytest

from dodo_dsl.spec.deployment import find_deployment
from dodo_dsl.spec.registry import Location, RegistryError, locate


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("tests/a/a.dodo.yml", "tests/sub/b/b.dodo.yml", "tests/.hidden/c/c.dodo.yml", "else/d/d.dodo.yml"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    (tmp_path / "else/plain.dodo.yml").touch()
    (tmp_path / "empty").mkdir()
    return tmp_path


def test_all_registries(folder: Path) -> None:
    found, empty = locate([], [folder / "tests"])
    root = folder / "tests"
    assert found == [Location(root / "a/a.dodo.yml", root), Location(root / "sub/b/b.dodo.yml", root)]
    assert empty == []


def test_files_and_folders(folder: Path) -> None:
    paths = [folder / "tests/sub", folder / "tests/sub/b/b.dodo.yml", folder / "empty", folder / "none.dodo.yml"]
    found, empty = locate(paths, [folder / "tests"])
    assert [(spec.stem, spec.root) for spec in found] == [("b", folder / "tests")]
    assert empty == [folder / "empty", folder / "none.dodo.yml"]


def test_roots_of_specs_outside_of_registries(folder: Path) -> None:
    found, _ = locate([folder / "else/d/d.dodo.yml", folder / "else/plain.dodo.yml"], [folder / "tests"])
    assert [spec.root for spec in found] == [folder / "else", folder / "else"]
    found, _ = locate([folder / "else/d"], [])
    assert [spec.root for spec in found] == [folder / "else"]
    found, _ = locate([folder], [])
    assert {spec.root for spec in found} == {folder}


@pytest.mark.parametrize("name", ["tests/x/x.dodo.yaml", "dodo.yaml"])
def test_a_file_of_the_other_suffix_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "tests" / "x").mkdir(parents=True)
    (tmp_path / name).touch()
    with pytest.raises(RegistryError, match=r"is not read: call it '.*[.]yml'"):
        locate([tmp_path / "tests"], [find_deployment(tmp_path) or tmp_path])
