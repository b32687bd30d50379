"""The emulated rig, built once where its tools are there."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.drive.applications import ROOT

SIMAVR = Path("/usr/include/simavr/sim_avr.h")


@pytest.fixture(scope="session")
def firmware() -> None:
    if shutil.which("avr-gcc") is None or not SIMAVR.is_file():
        pytest.skip("avr-gcc or simavr is missing: scripts/install-firmware-tools installs them on Debian")
    subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), "firmware", "emulator"], check=True)
