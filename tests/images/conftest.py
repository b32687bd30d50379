"""All images, built once for all tests from the base image that needs no registry."""

import contextlib
import functools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.firmware.programs import make

ROOT = Path(__file__).parents[2]
BASE, WITH_PROGRAMS = "dodo-test-base", "dodo-test-programs:images"
PROGRAMS = {"docker": "usr/local/bin", "bwrap": "usr/bin", "git": "usr/bin"}
PLUGINS = ("docker-compose", "docker-buildx")
SOURCE = "https://git.example.org/dodo"


def docker(*words: str, check: bool = True) -> str:
    """Standard output of a docker command; its standard error is in the failure."""
    result = subprocess.run(["docker", *words], capture_output=True, text=True, check=False, timeout=900)
    assert not check or result.returncode == 0, f"docker {' '.join(words)}: {result.stderr}"
    return result.stdout.strip()


def engine_answers() -> bool:
    try:
        return subprocess.run(["docker", "info"], capture_output=True, check=False, timeout=120).returncode == 0
    except FileNotFoundError:
        return False


@pytest.fixture(scope="session")
def base_image() -> str:
    """The base image; it is made where it is missing and can be."""
    if not engine_answers():
        pytest.skip("no Docker engine answers (scripts/start-engine starts one)")
    made = subprocess.run([ROOT / "scripts" / "test-base-image"], capture_output=True, text=True, check=False)
    if not docker("image", "ls", "--quiet", BASE):
        pytest.skip(f"there is no image {BASE}: {made.stdout or made.stderr}")
    return BASE


def build(base_image: str, *words: str) -> dict[str, str]:
    """References by name of images built as a user would."""
    command = [sys.executable, "-m", "dodo_dsl", "images", "build", *words, "--offline-wheels"]
    command += ["--base-image", base_image]
    variables = {**os.environ, "SOURCE": SOURCE, "DOCKER_IMAGE": WITH_PROGRAMS}
    result = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False, timeout=1800)
    assert result.returncode == 0, result.stdout[-4000:] + result.stderr
    lines = [line.split() for line in result.stdout.splitlines() if line.startswith("built ")]
    return {line[1].rpartition("/")[2].rpartition(":")[0]: line[1] for line in lines}


@functools.cache
def with_programs(base_image: str) -> str:
    """The base image with this machine's own programs that the image `dodo` has, so that its build needs no packages.

    All images stand on it, so that they share their layers with that of `dodo`. It is the base image alone if some of
    the programs are missing.
    """
    copied = {f"{where}/{name}": shutil.which(name) for name, where in PROGRAMS.items()}
    copied |= {f"usr/local/libexec/docker/cli-plugins/{name}": _plugin(name) for name in PLUGINS}
    if None in copied.values():
        return base_image
    with tempfile.TemporaryDirectory() as name:
        for target, source in copied.items():
            place = Path(name, "root", target)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(str(source), place)
        Path(name, "Dockerfile").write_text(f"FROM {base_image}\nCOPY root /\n")
        docker("build", "--quiet", "--tag", WITH_PROGRAMS, name)
    return WITH_PROGRAMS


def _plugin(name: str) -> str | None:
    places = (Path.home() / ".docker" / "cli-plugins", Path("/usr/libexec/docker/cli-plugins"))
    return next((str(folder / name) for folder in places if (folder / name).is_file()), None)


@functools.cache
def _all_images(base_image: str) -> dict[str, str]:
    if shutil.which("avr-gcc"):
        make("firmware", "emulator")
    return build(base_image)


@pytest.fixture(scope="session")
def built(base_image: str) -> dict[str, str]:
    """All images under the names that compiled tests ask for; the gantry's holds the emulated rig where it can be.

    They are built once, although this is another fixture in each folder that imports it.
    """
    return _all_images(with_programs(base_image))


@contextlib.contextmanager
def own_volume() -> Iterator[str]:
    """A volume that nobody else has."""
    name = docker("volume", "create")
    yield name
    docker("volume", "rm", "--force", name)


@pytest.fixture
def volume() -> Iterator[str]:
    """A volume of the test's own."""
    with own_volume() as name:
        yield name
