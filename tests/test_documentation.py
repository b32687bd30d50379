"""What the documentation shows is true: its specs compile, its commands exist, its examples run."""

import re
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest
import yaml

from dodo_dsl.cli.main import COMMANDS, main
from dodo_dsl.plan.application import read_application
from dodo_dsl.report.drive import read_ground
from dodo_dsl.spec.deployment import load_deployment

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```yaml\n(.*?)```", README, re.DOTALL)


def block(word: str) -> str:
    (found,) = [b for b in BLOCKS if word in b]
    return found


def test_the_spec_of_the_readme_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = re.search(r"name: (\S+)", block("evaluation:")).group(1)  # type: ignore[union-attr]
    spec = tmp_path / "tests" / name / f"{name}.dodo.yml"
    spec.parent.mkdir(parents=True)
    spec.write_text(block("evaluation:"))
    shutil.copytree(ROOT / "tests_registry" / "maps", tmp_path / "tests" / "maps")
    (tmp_path / "docker-compose.yml").write_text(block("x-dodo-process"))
    (tmp_path / "dodo.yml").write_text(block("registry:"))
    monkeypatch.chdir(tmp_path)
    stdout, stderr = StringIO(), StringIO()
    assert main(["compile", str(spec)], stdout, stderr) == 0, stdout.getvalue() + stderr.getvalue()


def test_the_other_blocks_are_what_they_say(tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    (tmp_path / "docker-compose.yml").write_text(block("x-dodo-process"))
    (tmp_path / "dodo.yml").write_text(block("registry:"))
    assert read_application(tmp_path / "docker-compose.yml")[1] == []
    assert load_deployment(tmp_path / "dodo.yml")[1] == []


def test_the_readme_names_every_command_and_flag() -> None:
    told = set(re.findall(r"`dodo ([a-z]+)", README))
    assert told == set(COMMANDS)
    for command, flag in re.findall(r"^\| `dodo (\w+)[^`]*?(--[a-z]+)", README, re.MULTILINE):
        stdout = subprocess.run(
            [sys.executable, "-m", "dodo_dsl", command, "--help"], capture_output=True, text=True, check=True
        ).stdout
        assert flag in stdout


MANIFESTS = sorted(p.parent for p in (ROOT / "services").glob("*/service.yml"))


@pytest.mark.parametrize("folder", MANIFESTS, ids=lambda p: p.name)
def test_services_help_ends_with_an_example(folder: Path) -> None:
    manifest = yaml.safe_load((folder / "service.yml").read_text())
    command = [sys.executable, "-m", f"services.{folder.name}", "--help"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    for parameter in manifest["parameters"]:
        assert f"--{parameter}" in result.stdout
    assert " ".join(manifest["process"]) in result.stdout.splitlines()[-1]
    assert (folder / "README.md").is_file()


@pytest.mark.parametrize("folder", sorted((ROOT / "tests_registry").glob("*/*.dodo.yml")), ids=lambda p: p.parent.name)
def test_every_test_has_a_readme(folder: Path) -> None:
    assert (folder.parent / "README.md").read_text().startswith(f"# {folder.parent.name}\n")


def test_the_map_of_the_page_is_one(tmp_path: Path) -> None:
    """Its obstacles and instances are what report and services read."""
    (text,) = re.findall(r"```json\n(.*?)```", (ROOT / "docs" / "maps.md").read_text(), re.DOTALL)
    (tmp_path / "map.json").write_text(text)
    ground = read_ground(tmp_path)
    assert [name for name, _ in ground.lines] == ["left", "right", "finish"]
    assert [len(points) for _, points in ground.models] == [2]


def test_the_readme_has_a_table_of_the_services() -> None:
    manifests = [(folder, yaml.safe_load((folder / "service.yml").read_text())) for folder in MANIFESTS]
    rows = [
        f"| [{about['name']}](services/{folder.name}) | {', '.join(about['layers'])} | {about['description']} |"
        for folder, about in manifests
        if not about.get("automatic")
    ]
    assert "\n".join(["|---|---|---|", *rows, ""]) in README
