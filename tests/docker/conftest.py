"""The images that compiled tests name by default, built from the base image that needs no registry."""

import shutil
import subprocess
import sys

import pytest

from tests.images.conftest import base_image  # noqa: F401
from tests.images.dockerfile import ROOT


@pytest.fixture(scope="session")
def images(base_image: str) -> None:  # noqa: F811
    """DoDo's images of this version under their default names; the gantry's holds the emulated rig where it can be."""
    if shutil.which("avr-gcc"):
        subprocess.run(["make", "-s", "-C", ROOT / "firmware", "firmware", "emulator"], check=False)
    command = [sys.executable, "-m", "dodo_dsl", "images", "build", "--offline-wheels", "--base-image", base_image]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=600)
    assert result.returncode == 0, result.stdout[-4000:] + result.stderr
