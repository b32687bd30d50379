"""The page of the architecture names what is there: its files, every folder, the layers of the import contract."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
FOLDERS = sorted({path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "dodo_dsl").rglob("*.py")})
TOPS = ("dodo_dsl", "services", "schemas", "templates", "tests_registry", "tests", "firmware", "examples", "benchmarks")
NAMED = sorted(name for name in set(re.findall(r"`([\w./-]+/[\w./-]*)`", PAGE)) if name.split("/")[0] in TOPS)


@pytest.mark.parametrize("name", NAMED)
def test_what_it_names_is_there(name: str) -> None:
    assert (ROOT / name).is_dir() if name.endswith("/") else (ROOT / name).exists()


@pytest.mark.parametrize("folder", [folder for folder in FOLDERS if "_data" not in folder])
def test_it_mentions_every_folder(folder: str) -> None:
    assert f"`{folder}/`" in PAGE
