"""The tutorial and the page for existing projects are what happens."""

import os
import re
import shutil
import sys
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from tests.contributing.tutorial import follow
from tests.examples.ros import PYTHON, needs_ros

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.slow
@pytest.mark.parametrize("page", ["tutorial/python.md", "how-to/existing-project.md"])
def test_a_page_can_be_followed(page: str, tmp_path: Path) -> None:
    follow(DOCS / page, tmp_path, Path(sys.executable).parent)


@needs_ros
@pytest.mark.proof
def test_the_page_for_ros_can_be_followed(tmp_path: Path) -> None:
    shutil.copytree(PYTHON.parents[1], tmp_path / ".ros", symlinks=True, copy_function=os.link)
    follow(DOCS / "tutorial" / "ros2.md", tmp_path, Path(sys.executable).parent)


EXAMPLES = ["README.md", "docs/reference/language.md", "docs/reference/maps.md"]


@pytest.mark.slow
@pytest.mark.parametrize("page", EXAMPLES)
def test_the_sample_application_passes_the_test_on_a_page(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of docs/reference/maps.md has no head."""
    root = DOCS.parent
    example = next(
        text for text in re.findall(r"```yaml\n(.*?)```", (root / page).read_text(), re.S) if "collision" in text
    )
    head = "dodo: 1\nname: sil-it\ndescription: Drive.\nlevel: sil\nkind: closed-loop\ntimeout: 60 s\nclock: lockstep\n"
    spec = example if example.startswith("dodo: 1") else head + example
    (name,) = re.findall("^name: ([a-z-]+)", spec, re.M)
    (tmp_path / "tests" / name).mkdir(parents=True)
    (tmp_path / "tests" / name / f"{name}.dodo.yml").write_text(spec)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\n")
    shutil.copytree(root / "tests_registry" / "maps", tmp_path / "tests" / "maps")
    monkeypatch.chdir(tmp_path)
    stdout, compose = StringIO(), root / "examples" / "kiwi" / "docker-compose.yml"
    assert main(["run", "--application", str(compose)], stdout, stdout) == 0, stdout.getvalue()
    assert "1 passed" in stdout.getvalue()
