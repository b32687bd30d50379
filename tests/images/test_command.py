"""dodo images: what it says and how it ends when something is missing."""

import json
import shutil
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.errors import Exit
from dodo_dsl.cli.main import main
from dodo_dsl.images.names import NoSuchImage, choose, known
from dodo_dsl.spec.manifest import load_manifests
from tests.images.dockerfile import ROOT


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


def test_unknown_names_are_usage(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    code, said = run("build", "colision")
    assert code == Exit.USAGE
    assert said == "dodo images: there is no image 'colision'; did you mean 'collision' or 'vision'?\n"


def test_names_are_those_of_the_manifests() -> None:
    manifests, _ = load_manifests()
    names = known(manifests.values())
    assert {"base", "vision", "sandbox", "collision", "virtual-camera"} <= set(names)
    one, two = choose(["vision", "collision"], names, "registry.example.org/dodo", "2")
    assert (one.reference, two.reference) == (
        "registry.example.org/dodo/vision:2",
        "registry.example.org/dodo/collision:2",
    )
    assert [image.name for image in choose([], names, "dodo", "1")] == list(names)
    assert [image.reference for image in choose(["dodo"], names, "here", "1")] == ["here/dodo:1"]
    with pytest.raises(NoSuchImage, match="known: base, beacon"):
        choose(["zzz"], names, "dodo", "1")


def test_without_docker(docker: Path) -> None:
    way = "install Docker Engine with its command line (https://docs.docker.com/engine/install)"
    assert run("build") == (Exit.ERROR, f"dodo images: the docker command is missing: {way}\n")


def test_without_an_engine(docker: Path) -> None:
    script(docker, "echo 'Cannot connect to the Docker daemon at unix:///x.sock.' >&2; exit 1")
    code, said = run("build")
    assert code == Exit.ERROR
    reason = "Cannot connect to the Docker daemon at unix:///x.sock"
    assert said.startswith(f"dodo images: no Docker engine answers ({reason}): ")


def test_without_buildx(docker: Path) -> None:
    script(docker, 'case "$1" in buildx) exit 1;; *) echo 28.0;; esac')
    code, said = run("build")
    assert code == Exit.ERROR
    assert said.startswith(
        "dodo images: docker has no buildx: install docker-buildx-plugin from Docker's own repository"
    )


def test_a_failed_build_shows_why_and_says_so(docker: Path) -> None:
    script(docker, 'case "$2" in bake) echo "#9 sh /opt/tools/requirements/install base: failed"; exit 1;; esac')
    code, said = run("build")
    assert code == Exit.ERROR
    assert "dodo images: the images cannot be built; the output above says why; if a build cannot reach" in said
    assert "#9 sh /opt/tools/requirements/install base: failed" in said


def test_a_base_image_without_python(docker: Path) -> None:
    script(docker, 'case "$1" in run) echo "exec: python3: not found" >&2; exit 127;; esac')
    code, said = run("build", "--offline-wheels", "--base-image", "busybox")
    assert code == Exit.ERROR
    assert said == "dodo images: base image busybox does not run python3: exec: python3: not found\n"


def test_push_asks_for_a_registry(docker: Path) -> None:
    code, said = run("push")
    assert (code, said) == (
        Exit.USAGE,
        "dodo images: no registry; name it with --prefix or as images.prefix in dodo.yml\n",
    )


def test_push_takes_the_deployments_names_and_wants_built_images(docker: Path, tmp_path: Path) -> None:
    (tmp_path / "dodo.yml").write_text('dodo: 1\nimages: {prefix: registry.example.org/team, tag: "7"}\n')
    script(docker, 'case "$1" in version) echo 28.0;; esac')
    code, said = run("push", "base", "collision")
    assert code == Exit.USAGE
    assert said == (
        "dodo images: registry.example.org/team/base:7 is not on this machine; "
        "build it first: dodo images build base collision\n"
    )


def test_the_names_of_the_command_line_stay(docker: Path) -> None:
    script(docker, 'case "$1" in version) echo 28.0;; esac')
    said = run("push", "base", "--prefix", "registry.example.org/mine", "--tag", "8")[1]
    assert said.endswith("first: dodo images build base --prefix registry.example.org/mine --tag 8\n")


def test_push_without_a_log_in_says_how(docker: Path) -> None:
    script(docker, 'case "$1" in push) echo "unauthorized: access to it is denied"; exit 1;; *) echo 1;; esac')
    code, said = run("push", "base", "--prefix", "registry.example.org/team", "--tag", "1")
    assert code == Exit.ERROR
    assert said.endswith("unauthorized: access to it is denied\n")
    assert (
        "base:1 cannot be pushed; the output above says why; log in with: docker login registry.example.org\n" in said
    )


def test_a_broken_deployment_is_usage(docker: Path, tmp_path: Path) -> None:
    (tmp_path / "dodo.yml").write_text("dodo: 1\nimages: {prefix: [1]}\n")
    code, said = run("build")
    assert code == Exit.USAGE
    assert "dodo.yml:2:" in said


def bake(docker: Path) -> None:
    """A docker command that keeps each definition that it is to build."""
    keep = f'cp docker-bake.json "$(mktemp {docker.parent}/bake-XXXXXX.json)"'
    size = 'case "$2" in inspect) echo 7000000;; *) echo 1;; esac'
    script(docker, f'PATH=/usr/bin:/bin; case "$1-$2" in buildx-bake) {keep};; image-*) {size};; esac')


def test_images_for_one_platform_have_the_usual_names(docker: Path) -> None:
    bake(docker)
    code, said = run("build", "collision", "--tag", "1", "--platform", "linux/arm64")
    (file,) = docker.parent.glob("bake-*.json")
    target = json.loads(file.read_text())["target"]["collision"]
    assert (code, target["platforms"], target["tags"]) == (0, ["linux/arm64"], ["dodo/collision:1"]), said


def test_images_for_several_platforms_have_their_own_tags(docker: Path) -> None:
    bake(docker)
    code, said = run("build", "collision", "--tag", "1", "--platform", "linux/arm64,linux/arm/v7")
    targets = [json.loads(file.read_text())["target"]["collision"] for file in docker.parent.glob("bake-*.json")]
    assert code == 0 and {(one["platforms"][0], one["tags"][0]) for one in targets} == {
        ("linux/arm64", "dodo/collision:1-arm64"),
        ("linux/arm/v7", "dodo/collision:1-arm-v7"),
    }
    assert said.count("7 MB") == 2


def test_several_platforms_are_pushed_as_a_list(docker: Path) -> None:
    platform = 'case "$5" in *amd64) echo linux/amd64;; *) echo linux/arm64;; esac'
    script(docker, f'case "$1-$2" in image-inspect) {platform};; image-ls) echo 1;; *) echo "$@";; esac')
    words = ("push", "collision", "--prefix", "registry.example.org/a", "--tag", "1")
    code, said = run(*words, "--platform", "linux/amd64,linux/arm64")
    image = "registry.example.org/a/collision:1"
    assert code == 0
    assert f"push {image}-amd64\n" in said and f"push {image}-arm64\n" in said
    assert f"buildx imagetools create --tag {image} {image}-amd64 {image}-arm64\n" in said


def test_what_was_built_for_another_platform_is_not_pushed(docker: Path) -> None:
    script(docker, 'case "$1-$2" in image-inspect) echo linux/amd64;; *) echo 1;; esac')
    code, said = run("push", "base", "--prefix", "registry.example.org/a", "--tag", "1", "--platform", "linux/arm64")
    assert (code, said) == (
        Exit.USAGE,
        "dodo images: registry.example.org/a/base:1 is for linux/amd64, not for linux/arm64\n",
    )


def test_a_wrong_platform_says_how_to_write_them(docker: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("build", "--platform", "arm64")[0] == Exit.USAGE
    assert "unknown platform 'arm64'; write platforms as linux/amd64,linux/arm64" in capsys.readouterr().err


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
    code, said = run("builds", "--contexts", str(docker.parent / "contexts"))
    assert code == Exit.OK, said
    context = Path(json.loads(said)["services"]["a"]["build"]["context"].replace("$$", "$"))
    found = sorted(path.name for path in context.rglob("*") if path.is_file())
    assert (context.name, found) == ("a$b", ["README.md", "docker-compose.yml", "dodo.yml", "main.py"])
    docker.write_text("a file")
    assert run("builds", "--contexts", str(docker))[0] == Exit.USAGE
