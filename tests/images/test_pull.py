"""``dodo images pull --for RIG``: which images, for which machine, and whether there is room; lists of platforms."""

import contextlib
import json
import os
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli.errors import Exit
from dodo_dsl.cli.main import main
from tests.check import examples
from tests.images.conftest import docker, engine_answers

LISTS = "application/vnd.docker.distribution.manifest.list.v2+json, application/vnd.oci.image.index.v1+json"
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


LAYER = {"digest": "base", "size": 40_000_000}
ANSWERS: dict[str, Any] = {
    "version": "linux/arm64",
    "buildx version": "1",
    "info": "/",
    "image ls": "",
    "buildx imagetools inspect --raw one:1@": {"layers": [LAYER, {**LAYER, "digest": "more", "size": 20_000_000}]},
    "buildx imagetools inspect --raw one:1": {
        "manifests": [
            {"digest": "sha256:a", "platform": {"os": "linux", "architecture": "amd64"}},
            {"digest": "sha256:b", "platform": {"os": "linux", "architecture": "arm64", "variant": "v8"}},
            {"digest": "sha256:c", "platform": {"os": "unknown", "architecture": "unknown"}},
        ]
    },
    "pull": "one:1: Pulling",
    "image inspect --format {{.Size}}": "150000000",
    "image inspect --format {{.Os}}": "linux/arm64",
}  # fmt: skip


@pytest.fixture
def answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What a docker command answers, by the beginning of its words; anything else it refuses."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    return dict(ANSWERS)


def faked(folder: Path, answers: dict[str, Any], keys: str, *words: str) -> tuple[int, str]:
    cases = [
        f"'{begin}'*) cat <<'END'\n{text if isinstance(text, str) else json.dumps(text)}\nEND\n;;"
        for begin, text in answers.items()
    ]
    lines = "\n".join(['case "$*" in', *cases, '*) echo "ERROR: $*" >&2; exit 1;;', "esac"])
    (folder / "bin" / "docker").write_text(f"#!/bin/sh\n{lines}\n")
    (folder / "bin" / "docker").chmod(0o755)
    return pull(folder, "one:1", keys, *words)


def test_room_is_that_of_images_that_are_not_there(tmp_path: Path, answers: dict[str, Any]) -> None:
    code, said = faked(tmp_path, answers, "disk: 1 GB")
    assert code == Exit.OK, said
    lines = said.splitlines()
    assert lines[0] == "made has a 'build': the first test builds it"
    assert lines[1].startswith("to fetch 60 MB, room about 180 MB of 180 MB, budget 1,000 MB, free ")
    assert lines[2:] == ["[1/1] one:1", "one:1  linux/arm64  150 MB"]
    answers["image ls"] = "sha256:1"
    assert "to fetch 0.0 MB, room about 0.0 MB of 180 MB, budget" in faked(tmp_path, answers, "disk: 1 GB")[1]


def test_a_budget_that_would_be_exceeded_is_refused_before_anything_is_pulled(
    tmp_path: Path, answers: dict[str, Any]
) -> None:
    del answers["pull"]
    code, said = faked(tmp_path, answers, "disk: 150 MB")
    assert (code, said.splitlines()[-1]) == (
        Exit.USAGE,
        "dodo images: the images of rig 'desk' take about 180 MB, and its 'disk' in dodo.yml is 150 MB; "
        "make them smaller, or the budget larger",
    )


def test_a_disk_that_is_too_full_is_refused(tmp_path: Path, answers: dict[str, Any]) -> None:
    del answers["pull"]
    size = 10**18
    answers["buildx imagetools inspect --raw one:1@"] = {"layers": [{**LAYER, "size": size}]}
    code, said = faked(tmp_path, answers, "")
    assert code == Exit.USAGE and "the images need about 3,000,000,000,000 MB more, and / has " in said


def test_an_image_for_other_machines_and_one_that_is_not_there(tmp_path: Path, answers: dict[str, Any]) -> None:
    listed = answers["buildx imagetools inspect --raw one:1"]["manifests"]
    answers["buildx imagetools inspect --raw one:1"] = {"manifests": listed[::2]}
    code, said = faked(tmp_path, answers, "")
    assert (code, said.splitlines()[-1]) == (
        Exit.ERROR, "dodo images: one:1 is for linux/amd64, not for linux/arm64"
    )  # fmt: skip
    del answers["buildx imagetools inspect --raw one:1"]
    code, said = faked(tmp_path, answers, "")
    assert code == Exit.ERROR and "one:1 is not to be had: buildx imagetools inspect --raw one:1" in said


def test_services_of_dodo_come_with_the_docker_backend_alone(tmp_path: Path, answers: dict[str, Any]) -> None:
    code, said = faked(tmp_path, answers, "arch: arm64", "--for", "desk", "--backend", "docker")
    assert code == Exit.ERROR and "dodo images: dodo/" in said


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
def test_a_list_of_platforms_is_pushed_and_each_rig_pulls_its_own(registry: str, tmp_path: Path) -> None:
    """The smallest images of both platforms under the names of DoDo's; the registry itself says what the list has."""
    (tmp_path / "Dockerfile").write_text("FROM scratch\nCOPY Dockerfile /\n")
    name = f"{registry}/dodo/sandbox"
    platforms = ("amd64", "arm64")
    try:
        for machine in platforms:
            words = ("--platform", f"linux/{machine}", "--load", "--tag", f"{name}:1-{machine}")
            docker("buildx", "build", "--quiet", *words, str(tmp_path))
        stdout = StringIO()
        listed = ",".join(f"linux/{machine}" for machine in platforms)
        words = ("--platform", listed, "--prefix", f"{registry}/dodo", "--tag", "1")
        assert main(["images", "push", "sandbox", *words], stdout, stdout) == Exit.OK, stdout.getvalue()
        request = urllib.request.Request(f"http://{registry}/v2/dodo/sandbox/manifests/1", headers={"Accept": LISTS})
        with urllib.request.urlopen(request, timeout=10) as answer:
            manifests = json.load(answer)["manifests"]
        assert [one["platform"] for one in manifests] == [{"architecture": m, "os": "linux"} for m in platforms]
        for machine in reversed(platforms):
            code, said = pull(tmp_path, f"{name}:1", f"arch: {machine}, disk: 1 MB")
            assert code == Exit.OK, said
            assert docker("image", "inspect", "--format", "{{.Architecture}}", f"{name}:1") == machine
        code, said = pull(tmp_path, f"{name}:1-arm64", "arch: amd64")
        assert code == Exit.ERROR and f"{name}:1-arm64 is for linux/arm64, not for linux/amd64" in said
    finally:
        docker("image", "rm", *(f"{name}:{tag}" for tag in ("1", "1-amd64", "1-arm64")), check=False)
