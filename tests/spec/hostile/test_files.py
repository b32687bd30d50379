"""Hostile files: problems are reported, nothing runs, and nothing is written elsewhere."""

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from tests.emit.readers import ROOT, run

GOOD = yaml.safe_load((ROOT / "tests_registry/sil-closed-straight/sil-closed-straight.dodo.yml").read_text())
DEPLOYMENT = {"dodo": 1, "registry": ["tests"], "application": "app.yml"}
PATIENCE_S = 60


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "repository"
    shutil.copytree(ROOT / "tests_registry" / "maps", path / "tests" / "maps")
    (path / "app.yml").write_text("services: {a: {image: x, command: --cid=111}}\n")
    (path / "dodo.yml").write_text(yaml.safe_dump(DEPLOYMENT))
    write(path, {**GOOD, "name": "t"})
    (tmp_path / "secret.dodo.yml").write_text("dodo: 1\ndescription: top secret\n")
    (tmp_path / "secret.yml").write_text("services: {a: {image: secret}}\n")
    return path


def write(folder: Path, spec: object) -> Path:
    path = folder / "tests" / "t" / "t.dodo.yml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(spec if isinstance(spec, str) else yaml.safe_dump(spec), encoding="utf-8")
    return path


def files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if "generated" not in p.parts}


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """Fails a test that waits forever, for a pipe for example."""

    def fail(*_: object) -> None:
        pytest.fail(f"the compiler waits for more than {PATIENCE_S} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(PATIENCE_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def compiled(folder: Path) -> tuple[int, str]:
    """The exit code and the output; nothing new may be beside the output folder."""
    before = files(folder.parent)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code, out, err = run("compile")
    assert files(folder.parent) == before
    assert code in (0, 2), err
    return code, out + err


def refused(folder: Path, rule: str) -> None:
    code, said = compiled(folder)
    assert code == 2, said
    assert f"[{rule}]" in said
    assert "secret\n" not in said
    assert len(said) < 100_000


def test_the_fixture_compiles(folder: Path) -> None:
    assert compiled(folder) == (0, "1 test compiled into generated\n")


@pytest.mark.parametrize("name", ["tests/t/t.dodo.yml", "app.yml", "dodo.yml", "tests/maps/straight/map.json"])
def test_a_pipe_that_nobody_writes(folder: Path, name: str) -> None:
    (folder / name).unlink()
    os.mkfifo(folder / name)
    code, said = compiled(folder)
    assert code in (0, 2), said  # a pipe is no spec, so that there may be nothing to compile


@pytest.mark.parametrize(
    ("spec", "rule"),
    [
        ({"extends": "link.dodo.yml"}, "path-escape"),
        ({"environment": {"camera": {"uses": "virtual-camera", "with": {"map-path": "../../../"}}}}, "path-escape"),
        ({"environment": {"camera": {"uses": "virtual-camera", "with": {"map-path": "up"}}}}, "path-escape"),
        ({"environment": {"camera": {"uses": "../virtual_camera"}}}, "unknown-service"),
        ({"seed": "!!python/object/apply:os.system ['touch pwned']"}, "wrong-type"),
    ],
)
def test_paths_and_names_that_lead_away(folder: Path, spec: dict[str, object], rule: str) -> None:
    (folder / "tests" / "t" / "link.dodo.yml").symlink_to(folder.parent / "secret.dodo.yml")
    (folder / "tests" / "t" / "up").symlink_to(folder.parent)
    write(folder, {**GOOD, "name": "t", **spec})
    refused(folder, rule)
