"""Files that a compose file asks for, where no application sees any."""

from pathlib import Path

import pytest

from dodo_dsl import compiler

_SERVICE = "services:\n  a:\n    image: a\n    command: --cid=111\n    "
_MESSAGES = {
    "tests": "a folder of tests or of DoDo's services",
    ".git": "where Git keeps its own",
    "generated": "the compiled tests",
    "dodo-report": "the report",
}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name in (*_MESSAGES, "data"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x").write_text("A=1\n")
    (tmp_path / "link").symlink_to(".git")
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
    return tmp_path


def _found(root: Path, written: str, *specs: Path) -> list[str]:
    (root / "docker-compose.yml").write_text(_SERVICE + written)
    found = [d for d in compiler.load(specs, sources=compiler.Sources(root)).diagnostics if d.severity == "error"]
    return [f"{Path(d.span.file).name}:{d.span.line}: {d.message}" for d in found]


@pytest.mark.parametrize("holder", _MESSAGES)
@pytest.mark.parametrize(
    ("written", "source", "line"),
    [
        ('volumes: ["./FOLDER/x:/x:ro"]', "./FOLDER/x", 5),
        ("env_file: FOLDER/x", "FOLDER/x", 5),
        ("build: FOLDER", "FOLDER", 5),
        ("configs: [c]\nconfigs:\n  c: {file: FOLDER/x}", "FOLDER/x", 7),
        ("secrets: [c]\nsecrets:\n  c: {file: ./FOLDER/x}", "./FOLDER/x", 7),
    ],
    ids=["volume", "env_file", "build", "config", "secret"],
)
def test_it_gets_none(holder: str, written: str, source: str, line: int, root: Path) -> None:
    message = f"'{holder}', {_MESSAGES[holder]}, which no application sees"
    expected = f"docker-compose.yml:{line}: '{source.replace('FOLDER', holder)}' lies in {message}"
    assert _found(root, written.replace("FOLDER", holder)) == [expected]
    assert _found(root, written.replace("FOLDER", "data")) == []


def test_nor_by_a_symlink(root: Path) -> None:
    assert _found(root, 'volumes: ["./link/x:/x"]') == [
        "docker-compose.yml:5: './link/x' lies in '.git', where Git keeps its own, which no application sees"
    ]


def test_nor_from_beside_a_test_outside_of_the_registries(root: Path) -> None:
    spec = root / "data" / "a.dodo.yml"
    spec.write_text("dodo: 1\n")
    found = _found(root, 'volumes: ["./data/x:/x"]', spec)
    assert [
        one for one in found if one.startswith("docker-compose.yml:5: './data/x' lies in 'data', a folder of tests")
    ]


def test_what_holds_all_of_it_is_mounted_without(root: Path) -> None:
    assert _found(root, 'volumes: [".:/x"]\n    build: .') == []
