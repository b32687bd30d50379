"""All images, built once for all tests from the base image that needs no registry."""

import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.firmware.programs import make
from tests.images.dockerfile import ROOT

BASE = "dodo-test-base"
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
    command += ["--base-image", base_image, "--source", SOURCE]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=1800)
    assert result.returncode == 0, result.stdout[-4000:] + result.stderr
    lines = [line.split() for line in result.stdout.splitlines() if line.startswith("built ")]
    return {line[1].rpartition("/")[2].rpartition(":")[0]: line[1] for line in lines}


@pytest.fixture(scope="session")
def built(base_image: str) -> dict[str, str]:
    """All images under the names that compiled tests ask for; the gantry's holds the emulated rig where it can be."""
    if shutil.which("avr-gcc"):
        make("firmware", "emulator")
    return build(base_image)


@pytest.fixture
def volume() -> Iterator[str]:
    """A volume of the test's own."""
    name = docker("volume", "create")
    yield name
    docker("volume", "rm", "--force", name)
