"""The files that compose finds by itself, judged by compose: each one that DoDo was not given is named."""

import subprocess
from pathlib import Path

import pytest

from tests.application.compiled import compiled, repository
from tests.emit.readers import compose

BASE = "services: {a: {image: x, command: --cid=111}}\n"
OVERRIDES = (
    "compose.override.yml",
    "compose.override.yaml",
    "docker-compose.override.yml",
    "docker-compose.override.yaml",
)
NAMES = ("compose.yaml", "compose.yml", "docker-compose.yml", "docker-compose.yaml")


def named(folder: Path, *files: str) -> list[str]:
    """The messages about files that compose reads beside these."""
    found = compiled(folder, application=list(files)).told
    return [told.text.split("'")[3] for told in found if told.rule == "application-override"]


def write(tmp_path: Path, *files: str) -> Path:
    folder = repository(tmp_path)
    for file in files:
        own = f"environment: {{read.{file}: x}}"
        (folder / file).write_text(f"services: {{a: {{image: x, command: --cid=111, {own}}}}}\n")
    return folder


@pytest.mark.slow
def test_they_are_those_that_compose_reads(tmp_path: Path) -> None:
    command = compose()
    root = write(tmp_path, *NAMES, *OVERRIDES)
    for base in NAMES:
        assert (root / base).is_file()
        for override in OVERRIDES:
            result = subprocess.run([*command, "config"], cwd=root, capture_output=True, text=True, check=True)
            read = {file for file in (*NAMES, *OVERRIDES) if f"read.{file}:" in result.stdout}
            assert {base, *named(root, base)} == read
            (root / override).unlink()
        (root / base).unlink()
        write(tmp_path, *OVERRIDES)


def test_a_file_that_compose_does_not_find_stands_alone(tmp_path: Path) -> None:
    root = write(tmp_path, "docker-compose.yml", "docker-compose.ci.yml", "docker-compose.override.yml")
    assert named(root, "docker-compose.ci.yml") == []
    assert named(root, "docker-compose.yml") == ["docker-compose.override.yml"]
    assert named(root, "docker-compose.yml", "docker-compose.override.yml") == []


def test_a_file_that_includes_the_base_is_the_way_to_do_without(tmp_path: Path) -> None:
    root = write(tmp_path, "docker-compose.yml", "docker-compose.override.yml")
    (root / "tested.yml").write_text("include: [docker-compose.yml]\nservices: {}\n")
    test = compiled(root, application="tested.yml")
    assert (list(test.services), test.told) == (["a"], ())


def test_what_env_names_is_compose_s_own(tmp_path: Path) -> None:
    root = write(tmp_path, "docker-compose.yml", "docker-compose.override.yml")
    (root / ".env").write_text("COMPOSE_FILE=docker-compose.yml\n")
    assert named(root, "docker-compose.yml") == []
