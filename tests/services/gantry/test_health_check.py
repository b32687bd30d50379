import math
from pathlib import Path

import pytest

from services.gantry.link import Link, RigError
from services.gantry.manual import find_home, read_state, run_checks
from services.gantry.memory import wanted
from services.gantry.motion import Conversion, MotionLimits
from services.gantry.rig_table import Status
from tests.services.gantry.fake_rig import FakeRig


@pytest.fixture
def line(tmp_path: Path) -> "tuple[FakeRig, Link]":
    """A rig whose home is found at once, wherever it is."""
    with FakeRig(tmp_path / "rig") as rig:
        link = Link(str(rig.path))
        yield rig, link
        link.close()


def test_the_home_is_inside_the_limits_by_less_than_a_millimetre() -> None:
    limits = MotionLimits()
    at = find_home(limits, Conversion())
    assert limits.holds(at) and at.yaw - limits.low.yaw == pytest.approx(1e-4)
    assert math.dist((at.x, at.y), (limits.low.x, limits.low.y)) == 0


def test_a_rig_that_is_not_calibrated_has_a_status_and_no_position(line: "tuple[FakeRig, Link]") -> None:
    rig, link = line
    rig.calibrated = False
    assert read_state(link) == (None, Status.NOT_CALIBRATED)
    rig.calibrated = True
    at, status = read_state(link)
    assert at is not None and (at.x, status) == (0.1, Status.IDLE)


def test_an_old_fault_fails_and_is_not_erased(line: "tuple[FakeRig, Link]") -> None:
    rig, link = line
    rig.status = int(Status.STALL)
    with pytest.raises(RigError, match="a motor stalled"):
        run_checks(link, wanted(None, Conversion()), 5.0)
    assert rig.status == Status.STALL
