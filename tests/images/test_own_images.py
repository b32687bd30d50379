"""``dodo images`` and a service of a repository's own, with a docker command that notes what it is asked."""

from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl import __version__
from dodo_dsl.cli.errors import Exit
from dodo_dsl.cli.main import main

MANIFEST = "layers: [evaluation]\ndescription: Judges.\nprocess: [python, -m, my_services.judge]\n"
DOCKERFILE = f"ARG DODO_BASE=dodo/base:{__version__}\nFROM ${{DODO_BASE}}\n"
PREFIX = "registry.example.org/team"


class Repository:
    """A repository with own services, its docker command, and what that was asked."""

    def __init__(self, root: Path) -> None:
        self.root, self.log = root, root / "asked"
        self.log.touch()
        (root / "dodo.yml").write_text("dodo: 1\nservices: [my_services]\n")
        (root / "bin").mkdir()
        script = (
            f'#!/bin/sh\nPATH=/usr/bin:/bin\necho "$@" >>{self.log}\n'
            f'case "$1-$2" in image-inspect) ;; *) echo 28;; esac\n'
        )
        (self.root / "bin/docker").write_text(script)
        (self.root / "bin/docker").chmod(0o755)

    def service(self, name: str, dockerfile: str = DOCKERFILE, image: str = "") -> Path:
        folder = self.root / "my_services" / name
        folder.mkdir(parents=True)
        (folder / "service.yml").write_text(f"name: {name}\nimage: {image or name}\n{MANIFEST}")
        if dockerfile:
            (folder / "Dockerfile").write_text(dockerfile)
        return folder

    def run(self, *words: str) -> tuple[int, str]:
        stdout, stderr = StringIO(), StringIO()
        code = main(["images", *words], stdout, stderr)
        return code, stderr.getvalue() + stdout.getvalue()

    def asked(self, *first: str) -> list[str]:
        return [line for line in self.log.read_text().splitlines() if line.startswith(" ".join(first))]


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Repository:
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.chdir(tmp_path)
    return Repository(tmp_path)


def test_it_is_built_on_the_base_of_the_same_prefix_and_tag(repository: Repository) -> None:
    """On the stage that the default in its Dockerfile names."""
    folder = repository.service("smoothness", DOCKERFILE.replace("base", "geometry"))
    code, said = repository.run("build", "smoothness", "--prefix", PREFIX, "--tag", "2")
    assert (code, said.splitlines()[-1]) == (0, f"built {PREFIX}/smoothness:2")
    (words,) = repository.asked("buildx", "build")
    assert words == (
        f"buildx build --load --file {folder}/Dockerfile --tag {PREFIX}/smoothness:2 "
        f"--build-arg DODO_BASE={PREFIX}/geometry:2 {repository.root}"
    )


def test_with_all_the_others_it_comes_after_what_it_stands_on(repository: Repository) -> None:
    repository.service("smoothness")
    repository.service("radar", dockerfile="")
    assert repository.run("build")[0] == 0
    asked = repository.asked("buildx b")
    assert [line.partition(" --")[0] for line in asked] == ["buildx bake", "buildx bake", "buildx build"]
    assert asked[0].endswith(" --load base"), "alone, so that the others find its layers"
    built = asked[1].partition(" --load ")[2].split()
    assert {"geometry", "collision"} <= set(built) and not {"base", "smoothness", "radar"} & set(built)


def test_what_is_missing(repository: Repository) -> None:
    folder = repository.service("smoothness", dockerfile="")
    code, said = repository.run("build", "smoothness", "--prefix", PREFIX)
    assert code == Exit.USAGE
    assert "there is no image 'smoothness', nor a Dockerfile next to its service.yml" in said
    (folder / "Dockerfile").write_text(DOCKERFILE)
    docker = repository.root / "bin/docker"
    docker.write_text(docker.read_text().replace("image-inspect)", "buildx-build) echo oh; exit 1;; image-inspect)"))
    code, said = repository.run("build", "smoothness")
    assert (code, "my_services/smoothness/Dockerfile cannot be built on dodo/base" in said) == (Exit.ERROR, True)


def test_it_is_pushed_with_the_others(repository: Repository) -> None:
    repository.service("smoothness")
    repository.service("radar", dockerfile="")
    words = ("--prefix", PREFIX, "--tag", "2", "--platform", "linux/amd64,linux/arm64")
    assert repository.run("push", *words)[0] == 0
    (words_of_it,) = repository.asked("buildx", "build")
    assert " --push --file " in words_of_it and "--platform linux/amd64,linux/arm64 " in words_of_it


def test_one_of_elsewhere_or_of_dodo_is_not_built(repository: Repository) -> None:
    repository.service("radar", image="registry.example.org/other/radar:1")
    repository.service("lane", image="collision")
    assert repository.run("build", "radar")[0] == Exit.USAGE
    assert repository.run("build", "collision")[0] == 0
    assert repository.asked("buildx", "build") == []
