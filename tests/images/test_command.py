"""dodo images: what it says and how it ends when something is missing."""

import shutil
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.errors import Exit
from dodo_dsl.cli.main import main
from tests.images.conftest import ROOT


def run(*words: str) -> tuple[int, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(["images", *words], stdout, stderr)
    return code, stderr.getvalue() + stdout.getvalue()


@pytest.fixture
def docker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is all of PATH, for a docker command that lacks something."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.chdir(tmp_path)
    return folder / "docker"


def script(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


HAS_NONE = 'case "$1" in version) echo 28.0;; esac'
FAILS = 'case "$2" in bake) exit 1;; esac'


@pytest.mark.parametrize(
    ("program", "words", "code", "said"),
    [
        (HAS_NONE, "build colision", Exit.USAGE, ["did you mean 'collision' or 'vision'?"]),
        (
            HAS_NONE,
            "build zzz",
            Exit.USAGE,
            ["nor a Dockerfile next to its service.yml; known: base, be"],
        ),
        ("", "build", Exit.ERROR, ["the docker command is missing: install Docker Engine"]),
        ("echo 'Cannot connect to x.' >&2; exit 1", "build", Exit.ERROR, ["failed; the output above says why"]),
        (FAILS, "build", Exit.ERROR, ["if a build cannot reach the package index, --offline-wheels downloads"]),
        (
            'case "$1" in run) echo "exec: python3: not found" >&2; exit 127;; esac',
            "build --offline-wheels --base-image busybox",
            Exit.ERROR,
            ["base image busybox does not run python3: exec: python3: not found"],
        ),
        (HAS_NONE, "push", Exit.USAGE, ["--prefix", "images.prefix in dodo.yml"]),
    ],
)
def test_what_is_missing(program: str, words: str, code: Exit, said: list[str], docker: Path) -> None:
    if program:
        script(docker, program)
    found, text = run(*words.split())
    assert found == code
    assert [each for each in said if each not in text] == [], text


def noting(docker: Path) -> Path:
    """A docker command that notes what it is asked to do, and the file with its notes."""
    notes = docker.parent / "notes"
    answers = "version-*) ;;"
    script(docker, f'case "$1-$2" in {answers} *) echo "$PREFIX $TAG $BASE_IMAGE:" "$@" >>{notes};; esac')
    return notes


BAKE = "buildx bake --file services/docker-bake.hcl"


def test_the_bake_file_is_built_or_pushed(docker: Path, tmp_path: Path) -> None:
    notes = noting(docker)
    words = ("--tag", "1", "--platform", "linux/arm64", "--base-image", "debian")
    code, said = run("build", "collision", "vision", *words)
    flags = f"{BAKE} --load --set *.platform=linux/arm64"
    assert notes.read_text().splitlines() == [f"dodo 1 debian: {flags} {n}" for n in ("vision", "collision")]
    assert (code, said) == (0, "built dodo/vision:1\nbuilt dodo/collision:1\n")
    notes.unlink()
    (tmp_path / "dodo.yml").write_text('dodo: 1\nimages: {prefix: registry.example.org/team, tag: "7"}\n')
    code, said = run("push", "base")
    assert notes.read_text() == f"registry.example.org/team 7 : {BAKE} --push base\n"
    assert (code, said) == (0, "pushed registry.example.org/team/base:7\n")


def test_what_is_there_for_one_platform_is_built_for_that_alone(docker: Path) -> None:
    notes = noting(docker)
    assert run("push", "--prefix", "a", "--platform", "linux/amd64,linux/arm64")[0] == 0
    both, rest, ros = [line.partition(" --push ")[2] for line in notes.read_text().splitlines()]
    assert both == "--set *.platform=linux/amd64,linux/arm64 base"
    assert rest.startswith("--set *.platform=linux/amd64,linux/arm64 geometry vision beacon ")
    assert ros == "--set *.platform=linux/amd64 ros-bridge"


def test_builds_have_contexts_of_their_own(docker: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a pipeline builds with bake holds no more than what a run builds, also with tests among its files."""
    root = docker.parent.parent / "a$b"
    for name in (".git/config", "tests/a/map.json", "generated/x", "dodo-report/x", "main.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("x")
    for name in ("sil-closed-straight", "maps/straight"):
        shutil.copytree(ROOT / "tests_registry" / name, root / name)
    (root / "dodo.yml").write_text("dodo: 1\nregistry: [., tests]\napplication: docker-compose.yml\n")
    (root / "docker-compose.yml").write_text("services: {a: {build: ., command: --cid=111}}\n")
    monkeypatch.chdir(root)
    told = '{"a": {"image.name": "r/a:latest", "containerimage.digest": "sha256:0"}}'
    script(docker, f"case $2 in bake) /bin/cp -a ${{4%/*}} {docker.parent}/kept; echo '{told}' > $7 ;; esac")
    assert run("builds", "--push", "r") == (Exit.OK, "DODO_IMAGE_A=r/a@sha256:0\n")
    (context,) = (docker.parent / "kept").rglob("a$b")
    found = sorted(path.name for path in context.rglob("*") if path.is_file())
    assert found == ["README.md", "docker-compose.yml", "dodo.yml", "main.py"]
    script(docker, "case $2 in bake) echo '{}' > $7 ;; esac")
    assert "the build of 'a' has said no digest" in run("builds", "--push", "r")[1]
