"""CONTRIBUTING's recipe for a service, followed word for word in a copy of the checkout."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text()
NEEDED = ("docs", "dodo_dsl", "locks", "schemas", "services", "templates", "tests", "tests_registry", "examples")
FILES = ("README.md", "constraints.txt", "dodo.yml", "pyproject.toml")

_BLOCK = re.compile(
    r"(?:(?P<verb>Write|Append to|Insert into) `(?P<file>[^`]+)`"
    r"(?: below the line with `(?P<anchor>[^`]+)`)?[^`]*?:\n\n)?"
    r"(?P<indent> +)```(?P<language>\w+)\n(?P<text>.*?)(?P=indent)```\n",
    re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A code block of the recipe and what to do with it: a verb and a file, or neither for commands."""

    verb: str | None
    file: str
    anchor: str
    language: str
    text: str


def recipe() -> list[Block]:
    section = PAGE.partition("## Add a service\n")[2].partition("\n## ")[0]
    blocks = [
        Block(m["verb"], m["file"] or "", m["anchor"] or "", m["language"], body(m)) for m in _BLOCK.finditer(section)
    ]
    assert len(blocks) == section.count("```") / 2, "each block needs a sentence that ends with 'Write `FILE`:'"
    return blocks


def body(match: re.Match[str]) -> str:
    """The block without the indentation of its step; what is indented beyond it stays so."""
    indent = match["indent"]
    return "".join(line.removeprefix(indent) for line in match["text"].splitlines(keepends=True))


def follow(block: Block, root: Path) -> None:
    path = root / block.file
    if block.verb == "Write":
        assert not path.exists(), f"the recipe overwrites {block.file}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text)
    elif block.verb == "Append to":
        path.write_text(path.read_text() + block.text)
    else:
        lines = path.read_text().splitlines(keepends=True)
        (number,) = [n for n, line in enumerate(lines) if block.anchor in line]
        path.write_text("".join([*lines[: number + 1], block.text, *lines[number + 1 :]]))


def run(root: Path, *words: str) -> str:
    """What a program prints in the copy, with the copy's DoDo and services; it has to succeed."""
    environment = {**os.environ, "PYTHONPATH": str(root), "DODO_LEASES": str(root / "leases"), "PYTEST_ADDOPTS": ""}
    command = [sys.executable, "-m", *words]
    result = subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert result.returncode == 0, f"{' '.join(words)}\n{result.stdout}{result.stderr}"
    return result.stdout


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what the recipe needs, with the recipe followed."""
    root = tmp_path_factory.mktemp("checkout")
    for name in NEEDED:
        shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in (*FILES, "CONTRIBUTING.md"):
        shutil.copy(ROOT / name, root / name)
    if (ROOT / ".mypy_cache").is_dir():  # what it knows of packages holds here, too
        shutil.copytree(ROOT / ".mypy_cache", root / ".mypy_cache")
    assert not (root / "services/odometer").exists()
    (root / "services/odometer").mkdir()
    (root / "services/odometer/__init__.py").touch()
    for block in recipe():
        if block.language != "console":
            follow(block, root)
    return root


def commands() -> Iterator[list[str]]:
    for block in recipe():
        if block.language == "console":
            yield from (line.removeprefix("$ dodo ").split() for line in block.text.splitlines())


@pytest.mark.slow
@pytest.mark.xdist_group("recipe")
def test_its_commands_show_the_service_and_pass_the_test(checkout: Path) -> None:
    printed = {words[0]: run(checkout, "dodo_dsl", *words) for words in commands()}
    assert list(printed) == ["list", "compile", "run"]
    assert printed["list"].startswith("odometer (evaluation): Judges whether the vehicle covers a distance in time.\n")
    assert printed["compile"].endswith(": no problems\n")
    assert re.search(r"^PASSED  sil-odometer .*  distance 2\.0\d* m \(at least 2 m\)$", printed["run"], re.MULTILINE)
    assert "\nodometer " in run(checkout, "dodo_dsl", "list", "--services")


@pytest.mark.slow
@pytest.mark.xdist_group("recipe")
@pytest.mark.proof
def test_what_checks_every_service_has_nothing_to_say(checkout: Path) -> None:
    run(checkout, "ruff", "format", "--check", "services/odometer", "tests/services/odometer")
    run(checkout, "ruff", "check", "services/odometer", "tests/services/odometer")
    run(checkout, "mypy", "--package", "services.odometer")
    subprocess.run([sys.executable, checkout / "scripts/make-schema"], cwd=checkout, check=True)
    tests = (
        "services/odometer",
        "images/test_dockerfile.py",
        "schemas",
        "test_documentation.py",
        "services/test_examples.py",
    )
    told = run(
        checkout, "pytest", "-q", *(f"tests/{name}" for name in tests), "-k", "odometer or table or schema or stand"
    )
    assert "passed" in told
