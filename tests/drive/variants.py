"""Variants of shipped tests, so that one run tries many applications: each variant has one of its own."""

import shutil
from pathlib import Path
from typing import Any

import yaml

from tests.drive.applications import ROOT


def registry(folder: Path) -> Path:
    """A copy of the shipped tests, which variants stand beside."""
    shutil.copytree(ROOT / "tests_registry", folder / "tests")
    return folder / "tests"


def variant(registry: Path, slug: str, name: str, **keys: Any) -> Path:
    """The spec ``name`` of one instance of a shipped test, ``sil-perception--light-1`` for example, with other keys."""
    shipped, *choices = slug.split("--")
    spec: dict[str, Any] = {"dodo": 1, "name": name, "extends": f"../{shipped}/{shipped}.dodo.yml"}
    if choices:
        pairs = (choice.partition("-") for choice in choices)
        spec["matrix"] = {key: [yaml.safe_load(value)] for key, _, value in pairs}
    path = registry / name / f"{name}.dodo.yml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(spec | keys, sort_keys=False))
    return path
