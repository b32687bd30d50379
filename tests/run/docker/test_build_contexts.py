"""What builds get of a repository: not its tests, their output and ``.git``."""

import os
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.run.docker.builds import HiddenContext, own_contexts

_FILES = (
    "Dockerfile", "app.py", "data/a.txt", ".git/config", "sub/.git/config", "tests/a.dodo.yml", "tests/map.json",
    "dodo-report/results.json", "b.dodo.yml", ".dockerignore",
)  # fmt: skip


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    root = tmp_path / "repository"
    for name in _FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(name)
    (root / "link").symlink_to("tests")
    os.mkfifo(root / "fifo")
    return root


def _built(root: Path, build: Any, folder: Path) -> dict[str, Any]:
    hidden = [root / ".git", root / "tests", root / "dodo-report", root / "b.dodo.yml"]
    folder.mkdir(exist_ok=True)
    found = own_contexts({"a": {"image": "a", "build": build, "command": "x"}}, hidden, folder, root)
    return dict(found["a"])


def _shown(folder: str) -> set[str]:
    return {str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_symlink() or not p.is_dir()}


def test_a_context_holds_nothing_that_no_application_sees(repository: Path, tmp_path: Path) -> None:
    found = _built(repository, {"context": str(repository), "dockerfile": "Dockerfile"}, tmp_path / "copies")
    assert set(found) == {"image", "build"}
    assert found["build"]["dockerfile"] == "Dockerfile"
    assert _shown(found["build"]["context"]) == {"Dockerfile", "app.py", "data/a.txt", ".dockerignore", "link"}
    copied, original = (Path(root, "app.py").stat() for root in (found["build"]["context"], repository))
    assert (copied.st_mtime_ns, copied.st_mode) == (original.st_mtime_ns, original.st_mode)
    assert Path(found["build"]["context"]).name == repository.name


@pytest.mark.parametrize("context", ["tests", "link", ".git", "sub/.git", "dodo-report"])
def test_hidden_folders_are_no_context(context: str, repository: Path, tmp_path: Path) -> None:
    with pytest.raises(
        HiddenContext, match=rf"the build of 'a' takes '.*{context}', where tests, their output or \.git"
    ):
        _built(repository, {"context": str(repository / context)}, tmp_path / "copies")
