"""The emulated rig, built once where its tools are there."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.drive.rig import Hardware
from tests.firmware.programs import make

SIMAVR = Path("/usr/include/simavr/sim_avr.h")


@pytest.fixture(scope="session")
def firmware() -> None:
    if shutil.which("avr-gcc") is None or not SIMAVR.is_file():
        pytest.skip("avr-gcc or simavr is missing: scripts/install-firmware-tools installs them on Debian")
    make("firmware", "emulator")


@pytest.fixture
def rig(tmp_path: Path, firmware: None) -> Iterator[Hardware]:
    with Hardware(tmp_path / "port") as one:
        one.until(lambda _: True, 60)
        yield one
