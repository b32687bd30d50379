"""The build context holds what the Dockerfile copies, from this checkout and as a checkout has it."""

import re
from pathlib import Path

import pytest

from dodo_dsl import package_data
from dodo_dsl.images import build_context
from tests.images.conftest import ROOT


def copied() -> set[str]:
    """What the Dockerfile copies from the context, beside what may be missing there."""
    text = (ROOT / "services" / "Dockerfile").read_text()
    lines = re.findall(r"^COPY (?!--)(.*) \S+$", text, re.MULTILINE)
    return {word for line in lines for word in line.split() if "[" not in word}


def test_it_has_what_the_dockerfile_copies(tmp_path: Path) -> None:
    build_context.assemble(tmp_path)
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")}
    assert {"locks/base.txt", "dodo_dsl/opendlv", "services/gantry/service.yml"} <= copied() <= found
    assert {build_context.BAKE, "services/Dockerfile.dockerignore", "dodo_dsl/cli/main.py"} <= found
    assert not [name for name in found if "__pycache__" in name or name.startswith(("wheels", "tests/", ".git"))]
    assert (tmp_path / "services/base/loop.py").stat().st_mtime == (ROOT / "services/base/loop.py").stat().st_mtime


def test_the_engine_gets_no_less_than_is_copied() -> None:
    sent = [line[1:] for line in (ROOT / "services/Dockerfile.dockerignore").read_text().splitlines() if line[0] == "!"]
    assert {"wheels", "build/firmware", "build/time"} <= set(sent)
    assert [name for name in copied() if not any(f"{name}/".startswith(f"{one}/") for one in sent)] == []


def test_builds_come_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tmp_path / "root"
    for file in (root / "build/time/dodo-time", root / "build/firmware/gantry.elf"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    monkeypatch.setattr(package_data, "root", lambda: root)
    build_context.assemble(tmp_path / "context")
    for name in ("build/time/dodo-time", "build/firmware/gantry.elf"):
        assert (tmp_path / "context" / name).is_file()


def test_without_a_base_image_the_dockerfile_decides() -> None:
    assert build_context.default_base_image().startswith("python:3.")
