import math
from typing import Any

import pytest

from dodo_dsl.opendlv.assets.trajectory import TrajectoryError
from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context
from services.base.flags import load_manifest, parse
from services.beacon.service import Beacon
from tests.services.process import ROOT

SECOND = 1_000_000


def service(*flags: str) -> Beacon:
    manifest = load_manifest(ROOT / "services" / "beacon")
    return Beacon(Context("beacon", parse(manifest, ["--cid=1", *flags]), MessageSet.standard()))


def sent(beacon: Beacon, now: int) -> list[Any]:
    return list(beacon.update(now))


def test_it_waits_for_the_test_and_ends_with_its_trajectory() -> None:
    beacon = service("--points=0 0,2 0", "--speed=1", "--freq=10", "--frame-id=3")
    assert beacon.period == 100_000
    for now in (0, 9 * SECOND):
        (output,) = sent(beacon, now)
        assert (output.message.x, output.sender_stamp, beacon.finished) == (0, 3, False)
    beacon.begin(10 * SECOND)
    beacon.begin(11 * SECOND)
    assert sent(beacon, 11 * SECOND)[0].message.x == pytest.approx(1)
    assert not beacon.finished
    assert sent(beacon, 12 * SECOND)[0].message.x == 2
    assert beacon.finished


def test_the_state_is_sent_when_asked() -> None:
    beacon = service("--length=9", "--yaw=90", "--speed=1.5", "--state-id=7")
    still = sent(beacon, 0)[1]
    assert (still.sender_stamp, still.message.vx) == (7, 0)
    beacon.begin(0)
    frame, state = sent(beacon, SECOND)
    assert (state.message.vx, state.message.vy) == pytest.approx((1.5, 0))
    assert (frame.message.x, frame.message.y) == pytest.approx((0, 1.5))
    assert (frame.message.qz, frame.message.qw) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))


def test_two_ways_are_one_too_many() -> None:
    with pytest.raises(TrajectoryError, match="--points and --length exclude each other"):
        service("--points=0 0,1 1", "--length=3")
