"""The emulated rig, built once where its tools are there."""

import shutil
from pathlib import Path

import pytest

from tests.firmware.programs import make

SIMAVR = Path("/usr/include/simavr/sim_avr.h")


@pytest.fixture(scope="session")
def firmware() -> None:
    if shutil.which("avr-gcc") is None or not SIMAVR.is_file():
        pytest.skip("avr-gcc or simavr is missing: scripts/install-firmware-tools installs them on Debian")
    make("firmware", "emulator")
