"""Builds the firmware and what tests it, once; BENCH names another build of the core's test program instead."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.firmware.programs import BUILT, Bench, Rig, make

SIMAVR = Path("/usr/include/simavr/sim_avr.h")
CLOSE = (-0.8, -0.6, -141.7)
"""Near home (m, m, degrees), so that homing is short. x and y are whole electrical turns from it, so that no rotor
stands exactly between two poles in the middle."""


@pytest.fixture(scope="session")
def bench_program() -> Path:
    if "BENCH" in os.environ:
        return Path(os.environ["BENCH"])
    if shutil.which("gcc") is None or shutil.which("make") is None:
        pytest.skip("gcc or make is missing: scripts/install-firmware-tools installs them on Debian")
    make("bench")
    return BUILT / "bench"


@contextlib.contextmanager
def in_the_middle(program: Path) -> Iterator[Bench]:
    """A core that is calibrated, stands in the middle and looks forward."""
    with Bench(program, CLOSE) as bench:
        bench.calibrate()
        bench.go(0, 0, 0)
        bench.extremes()
        yield bench


@pytest.fixture(scope="session")
def circle_program(bench_program: Path) -> Path:
    """The core of a rig that turns without end."""
    return Path(os.environ["BENCH"]) if "BENCH" in os.environ else BUILT / "bench-circle"


@pytest.fixture
def circle(circle_program: Path) -> Iterator[Bench]:
    """The same, calibrated and in the middle, looking forward."""
    with in_the_middle(circle_program) as bench:
        yield bench


@pytest.fixture(scope="session")
def firmware() -> None:
    """The binary and its emulator are there."""
    if shutil.which("avr-gcc") is None or not SIMAVR.is_file():
        pytest.skip("avr-gcc or simavr is missing: scripts/install-firmware-tools installs them on Debian")
    make("firmware", "emulator")


@pytest.fixture
def fresh(bench_program: Path) -> Iterator[Bench]:
    """The core as it starts."""
    with Bench(bench_program) as bench:
        yield bench


@pytest.fixture
def bench(bench_program: Path) -> Iterator[Bench]:
    """The core, calibrated and in the middle."""
    with in_the_middle(bench_program) as bench:
        yield bench


@pytest.fixture
def new_rig(firmware: None) -> Iterator[Rig]:
    """The emulated rig as it starts, with its port open."""
    with Rig() as rig:
        rig.open()
        yield rig


@pytest.fixture
def rig(new_rig: Rig) -> Rig:
    """The emulated rig, calibrated and away from all edges."""
    new_rig.calibrate()
    new_rig.go(-0.4, -0.3, -1)
    new_rig.extremes()
    return new_rig
