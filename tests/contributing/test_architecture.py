"""The page of the architecture names what is there: its files, every folder, the layers of the import contract."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
FOLDERS = sorted({path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "dodo_dsl").rglob("*.py")})
TOPS = ("dodo_dsl", "services", "schemas", "templates", "tests_registry", "tests", "firmware", "examples", "benchmarks")
NAMED = sorted(name for name in set(re.findall(r"`([\w./-]+/[\w./-]*)`", PAGE)) if name.split("/")[0] in TOPS)
PAGES = [*ROOT.glob("*.md"), *(page for top in (*TOPS, "docs") for page in (ROOT / top).rglob("*.md"))]


def rows(title: str) -> list[list[str]]:
    """The cells of a section's table."""
    section = PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


@pytest.mark.parametrize("name", NAMED)
def test_what_it_names_is_there(name: str) -> None:
    assert (ROOT / name).is_dir() if name.endswith("/") else (ROOT / name).exists()


@pytest.mark.parametrize("folder", [folder for folder in FOLDERS if "_data" not in folder])
def test_it_mentions_every_folder(folder: str) -> None:
    assert f"`{folder}/`" in PAGE


def test_each_step_is_a_file() -> None:
    steps = rows("From spec to verdict")
    assert [step[0] for step in steps] == [str(number) for number in range(1, len(steps) + 1)]
    assert all((ROOT / step[1].strip("`")).is_file() for step in steps)


def test_its_layers_are_those_of_the_contract() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = [contract["layers"] for contract in contracts if contract["type"] == "layers"]
    beside = [set(layer.split(" | ")) for layer in layers]
    named = [row[0].strip("`") for row in rows("What may import what")]
    assert len(named) == sum(map(len, beside))
    for layer in beside:
        assert set(named[: len(layer)]) == layer
        del named[: len(layer)]


PICTURE = PAGE.partition("```\n")[2].partition("```")[0]
STAGES = ("source", "application", "check", "plan", "emit", "run", "outcome", "report")
"""What the picture shows from top to bottom."""


def imported(stage: str) -> set[str]:
    """The parts of ``dodo_dsl`` that a stage's modules import."""
    package = ROOT / "dodo_dsl" / stage
    found = set()
    for path in package.rglob("*.py") if package.is_dir() else [package.with_suffix(".py")]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("dodo_dsl"):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
                found |= {name.split(".")[1] for name in names}
    return found - {stage}


def test_its_picture_shows_what_imports_what() -> None:
    """Data flows down: each stage imports one that is above it, and none that is below."""
    places = [re.search(rf"\b{stage}\b", PICTURE) for stage in STAGES]
    shown = [place.start() for place in places if place]
    assert len(shown) == len(STAGES)
    assert shown == sorted(shown)
    for number, stage in enumerate(STAGES):
        others = imported(stage)
        made = {"outcome"} if stage == "run" else set()
        assert others.isdisjoint({*STAGES[number + 1 :]} - made), f"{stage} imports what gets its results"
        assert number == 0 or stage == "outcome" or others & {*STAGES[:number]}, f"{stage} gets nothing from above"


def test_the_glossary_is_short_and_in_order() -> None:
    words = [row[0] for row in rows("Glossary")]
    assert 20 <= len(words) <= 40
    assert words == sorted(set(words), key=str.lower)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_between_pages_lead_somewhere(path: Path) -> None:
    prose = re.sub(r"^ *```.*?^ *```", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", prose)
    assert [link for link in links if not (path.parent / link).exists()] == []
