"""All images, built once for these tests from the base image that needs no registry."""

import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.images.dockerfile import ROOT

BASE = "dodo-test-base"
PREFIX, TAG = "dodo-test", "images"


def docker(*words: str, check: bool = True) -> str:
    """Standard output of a docker command; its standard error is in the failure."""
    result = subprocess.run(["docker", *words], capture_output=True, text=True, check=False, timeout=300)
    assert not check or result.returncode == 0, f"docker {' '.join(words)}: {result.stderr}"
    return result.stdout.strip()


def engine_answers() -> bool:
    try:
        return subprocess.run(["docker", "info"], capture_output=True, check=False, timeout=30).returncode == 0
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


@pytest.fixture(scope="session")
def built(base_image: str) -> Iterator[dict[str, str]]:
    """References of all images by name, built as a user would; the names are taken away afterwards."""
    command = [sys.executable, "-m", "dodo_dsl", "images", "build", "--offline-wheels", "--base-image", base_image]
    command += ["--prefix", PREFIX, "--tag", TAG, "--source", "https://git.example.org/dodo"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=600)
    assert result.returncode == 0, result.stdout[-4000:] + result.stderr
    lines = [line.split() for line in result.stdout.splitlines() if line.startswith("built ")]
    references = {line[1].rpartition("/")[2].rpartition(":")[0]: line[1] for line in lines}
    yield references
    docker("image", "rm", "--force", *references.values())


@pytest.fixture
def volume() -> Iterator[str]:
    """A volume of the test's own."""
    name = docker("volume", "create")
    yield name
    docker("volume", "rm", "--force", name)
