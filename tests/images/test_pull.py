"""``dodo images pull --for RIG``: which images, for which machine, and how large they may be."""

import contextlib
import os
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.errors import Exit
from dodo_dsl.cli.main import main
from tests.check import examples
from tests.images.conftest import docker, engine_answers, with_programs

COMPOSE = """services:
  driver:
    image: ${{DODO_IMAGE_DRIVER:-{image}}}
    command: --cid=111
    x-dodo: {{out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}}
  made: {{build: ., command: --cid=111}}
"""
RIGS = "rigs: {{desk: {{kind: static, cid: 121, {keys}}}, idle: {{kind: static, cid: 122}}}}\n"


def pull(folder: Path, image: str, keys: str, *words: str) -> tuple[int, str]:
    """The command in a repository with a test on the rig ``desk``."""
    examples.write("level: hil\nrig: desk\n", folder)
    (folder / "docker-compose.yml").write_text(COMPOSE.format(image=image))
    rigs = RIGS.format(keys=keys or "privileged: false")
    (folder / "dodo.yml").write_text(f"dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n{rigs}")
    stdout = StringIO()
    with contextlib.chdir(folder):
        code = main(["images", "pull", *(words or ("--for", "desk"))], stdout, stdout)
    return code, stdout.getvalue()


ANSWERS = {
    "version": "linux/arm64",
    "buildx version": "1",
    "pull": "one:1: Pulling",
    "image inspect --format {{.Size}}": "150000000",
    "image inspect --format {{.Os}}": "linux/arm64",
}


@pytest.fixture
def answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """What a docker command answers, by the beginning of its words; anything else it refuses."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    return dict(ANSWERS)


def faked(folder: Path, answers: dict[str, str], keys: str, *words: str) -> tuple[int, str]:
    cases = [f"'{begin}'*) cat <<'END'\n{text}\nEND\n;;" for begin, text in answers.items()]
    lines = "\n".join(['case "$*" in', *cases, '*) echo "ERROR: $*" >&2; exit 1;;', "esac"])
    (folder / "bin" / "docker").write_text(f"#!/bin/sh\n{lines}\n")
    (folder / "bin" / "docker").chmod(0o755)
    return pull(folder, "one:1", keys, *words)


def test_what_it_pulls_and_how_large_that_is(tmp_path: Path, answers: dict[str, str]) -> None:
    code, said = faked(tmp_path, answers, "disk: 1 GB")
    assert code == Exit.OK, said
    first, *rest = said.splitlines()
    assert first == "made has a 'build': the first test builds it"
    assert rest == ["[1/1] one:1", "the tests of rig 'desk' need 1 images of a registry, 150 MB"]
    code, said = faked(tmp_path, answers, "disk: 140 MB")
    budget = "dodo images: the images of rig 'desk' take up to 150 MB, and its 'disk' in dodo.yml is 140 MB; "
    assert (code, said.splitlines()[-1]) == (Exit.USAGE, f"{budget}make them smaller, or the budget larger")


def test_an_image_for_other_machines_and_one_that_is_not_there(tmp_path: Path, answers: dict[str, str]) -> None:
    answers["image inspect --format {{.Os}}"] = "linux/amd64"
    code, said = faked(tmp_path, answers, "")
    assert (code, said.splitlines()[-1]) == (Exit.ERROR, "dodo images: one:1 is for linux/amd64, not for linux/arm64")
    del answers["pull"]
    code, said = faked(tmp_path, answers, "")
    assert code == Exit.ERROR and "one:1 cannot be pulled; the output above says why" in said


def test_services_of_dodo_come_with_the_docker_backend_alone(tmp_path: Path, answers: dict[str, str]) -> None:
    code, said = faked(tmp_path, answers, "arch: arm64", "--for", "desk", "--backend", "docker")
    assert code == Exit.OK and "] dodo/virtual-camera:" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--for", "desc"), "unknown rig 'desc' in dodo.yml; did you mean 'desk'?"),
        (("--for", "idle"), "no test runs on rig 'idle'"),
    ],
)
def test_rigs_without_tests(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    assert pull(tmp_path, "one:1", "", *words) == (Exit.USAGE, f"dodo images: {said}\n")


@pytest.mark.thorough
def test_tests_that_cannot_be_read_may_be_the_rigs(tmp_path: Path) -> None:
    pull(tmp_path, "one:1", "")
    for spec in (tmp_path / "tests").rglob("*.dodo.yml"):
        spec.write_text(spec.read_text() + "extends: ../nowhere.dodo.yml\n")
    stdout = StringIO()
    with contextlib.chdir(tmp_path):
        assert main(["images", "pull", "--for", "desk"], stdout, stdout) == Exit.USAGE
    said = "no test runs on rig 'desk' of those without problems; dodo compile --check shows the others"
    assert stdout.getvalue() == f"dodo images: {said}\n"


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a registry of its own."""
    if not shutil.which("docker-registry") or not engine_answers():
        pytest.skip("no docker-registry (scripts/install-test-tools), or no Docker engine (scripts/start-engine)")
    folder = tmp_path_factory.mktemp("registry")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    storage = f"storage: {{filesystem: {{rootdirectory: {folder / 'data'}}}}}"
    config = f'version: 0.1\nlog: {{level: error}}\n{storage}\nhttp: {{addr: "{address}"}}\n'
    (folder / "config.yml").write_text(config)
    with subprocess.Popen(
        ["docker-registry", "serve", str(folder / "config.yml")], stdout=subprocess.DEVNULL
    ) as server:
        for _ in range(100):
            with contextlib.suppress(OSError), urllib.request.urlopen(f"http://{address}/v2/", timeout=5):
                break
            time.sleep(0.1)
        yield address
        server.terminate()


@pytest.mark.engine
@pytest.mark.usefixtures("built")
def test_what_is_pushed_is_what_a_rig_pulls(registry: str, base_image: str, tmp_path: Path) -> None:
    name = f"{registry}/dodo/sandbox"
    words = [
        "--prefix",
        f"{registry}/dodo",
        "--tag",
        "1",
        "--offline-wheels",
        "--base-image",
        with_programs(base_image),
    ]
    try:
        stdout = StringIO()
        assert main(["images", "push", "sandbox", *words], stdout, stdout) == Exit.OK, stdout.getvalue()
        docker("image", "rm", f"{name}:1", check=False)
        machine = docker("version", "--format", "{{.Server.Arch}}")
        code, said = pull(tmp_path, f"{name}:1", f"arch: {machine}")
        assert code == Exit.OK, said
        assert docker("image", "inspect", "--format", "{{.Architecture}}", f"{name}:1") == machine
    finally:
        docker("image", "rm", f"{name}:1", check=False)
