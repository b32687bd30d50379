"""Vehicles by velocity: what a GroundMotionRequest makes of each drive, against closed-form solutions."""

import logging
import math
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from services.dynamic_model.drives import GRAVITY
from services.dynamic_model.model import BodyMotion
from services.dynamic_model.service import DynamicModel
from tests.services.dynamic_model.test_service import AXLES, PEDALS, SPEED, service

MOTION = "opendlv.proxy.GroundMotionRequest"
SMALL = {"drive": "bicycle", "wheel-base": 0.3, "cg": 0.15, "steering-rate": 600, "speed-lag": 0.1}
WHEELS = {"drive": "differential", "motor-lag": 0}
DEG = math.radians(1)


def hand(model: DynamicModel, name: str = MOTION, stamp: int | None = None, **fields: Any) -> None:
    model.inputs[name, stamp](MessageSet.standard().type(name)(**fields), 0)


def after(model: DynamicModel, end: float, begin: float = 0.0) -> BodyMotion:
    """The motion at the end, in s, of steps of 10 ms."""
    for now in range(round(begin * 100), round(end * 100) + 1):
        model.update(now * 10_000)
    return model.vehicle.motion


@pytest.mark.parametrize("flags", [{"drive": "differential"}, SMALL, {}], ids=str)
@pytest.mark.parametrize(
    ("vx", "yaw_rate"), [(0.5, 0.0), (0.6, 0.8), (0.6, -0.8), (-0.5, 0.0), (-0.4, 0.5), (0.0, 0.0)]
)
def test_the_body_moves_as_it_is_asked(flags: dict[str, Any], vx: float, yaw_rate: float) -> None:
    """Straight, on arcs of the radius v/w, in reverse, and not at all."""
    model = service(**flags)
    hand(model, vx=vx, yawRate=yaw_rate)
    motion = after(model, 4.0)
    assert (motion.vx, motion.yaw_rate) == pytest.approx((vx, yaw_rate), abs=2e-3)


@pytest.mark.parametrize(
    ("flags", "vx", "yaw_rate", "expected"),
    [
        (WHEELS, 0.0, 1.5, (0.0, 1.5)),  # in place, as no car that steers does
        (SMALL, 0.0, 1.5, (0.0, 0.0)),
        ({}, 0.0, 1.5, (0.0, 0.0)),
        (WHEELS, -2.0, 0.0, (-0.7, 0.0)),
        (WHEELS, 0.0, 9.0, (0.0, math.pi)),
        ({**WHEELS, "max-speed": 0.22, "max-yaw-rate": 90}, 2.0, -9.0, (0.22, -math.pi / 2)),
        ({**WHEELS, "max-speed": 9, "max-yaw-rate": 3600}, 0.91, 13.0, (0.455, 6.5)),  # the radius stays
        ({**WHEELS, "power": 0.5}, 0.7, 0.0, (0.455, 0.0)),
        ({**WHEELS, "dead-zone": 0.5}, 0.01, 0.0, (0.01, 0.0)),  # which is the pedal's
        ({**WHEELS, "wheel-offset": 0.1}, 0.5, 0.0, (0.5, 0.5 * 0.1 / 0.14)),
        ({**WHEELS, "slip": 0.2}, 0.5, 1.0, (0.4, 0.8)),
        (SMALL, 0.3, 9.0, (0.3, 0.3 / 0.3 * math.tan(35 * DEG))),
        ({**SMALL, "top-speed": 0.4}, 0.8, 0.5, (0.4, 0.5)),
        ({**SMALL, "speed-input": "acceleration"}, -0.5, 0.2, (-0.5, 0.2)),
        ({**SMALL, "steering-offset": 2}, 0.3, 0.0, (0.3, math.tan(2 * DEG))),
        ({}, 2.0, 0.0, (0.91, 0.0)),
        ({}, -2.0, 0.0, (-1.125, 0.0)),
        ({"power": 0.5}, 0.4, 0.0, (0.4, 0.0)),
        ({}, 0.05, 1.0, (0.05, 0.0)),  # its tyres carry above 0.1 m/s
    ],
)
def test_limits_slip_and_what_is_wrong_with_a_car(
    flags: dict[str, Any], vx: float, yaw_rate: float, expected: tuple[float, float]
) -> None:
    model = service(**flags)
    hand(model, vx=vx, yawRate=yaw_rate)
    motion = after(model, 5.0)
    assert (motion.vx, motion.yaw_rate) == pytest.approx(expected, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (WHEELS, 0.5),
        ({**WHEELS, "max-acceleration": 0.9}, 0.9 * 0.2),
        ({**WHEELS, "motor-lag": 0.1}, 0.5 * -math.expm1(-2.0)),
        ({**WHEELS, "friction": 0.1}, 0.1 * GRAVITY * 0.2),
        ({**WHEELS, "latency": 0.15}, 0.05 * GRAVITY),
        ({**WHEELS, "latency": 0.15, "max-acceleration": 0.9}, 0.9 * 0.05),
        ({**WHEELS, "latency": 0.25}, 0.0),
        ({"drive": "bicycle", "speed-lag": 0.01}, 0.5),
        ({"drive": "bicycle", "speed-lag": 0.01, "max-acceleration": 1}, 0.2),
    ],
)
def test_dead_time_and_acceleration(flags: dict[str, Any], expected: float) -> None:
    """Speed 0.2 s after 0.5 m/s was asked for."""
    model = service(**flags)
    model.update(0)
    hand(model, vx=0.5)
    assert after(model, 0.2, 0.01).vx == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("flags", "name", "stamps", "fields", "speed"),
    [
        ({"drive": "differential"}, PEDALS, (0, 1), {"position": 0.525}, 0.455),
        ({"drive": "differential", "wheel-input": "axle"}, AXLES, (0, 1), {"axleAngularVelocity": 10.0}, 0.325),
        ({**SMALL, "latency": 0.1}, SPEED, (None,), {"groundSpeed": 0.6}, 0.6),
        ({"latency": 0.1}, PEDALS, (None,), {"position": 0.1}, 0.65),
    ],
)
def test_the_last_kind_of_request_counts(
    flags: dict[str, Any], name: str, stamps: tuple[int | None, ...], fields: dict[str, float], speed: float
) -> None:
    """And of the other kind nothing is left: of two wheels one stands if only the other one is asked to turn."""
    model = service(**flags)
    model.update(0)
    hand(model, vx=0.3, yawRate=0.5)
    assert after(model, 3.0, 0.01).vx == pytest.approx(0.3, rel=1e-3)
    for stamp in stamps:
        hand(model, name, stamp, **fields)
    motion = after(model, 8.0, 3.01)
    assert (motion.vx, motion.yaw_rate) == pytest.approx((speed, 0.0), rel=1e-3, abs=1e-6)
    hand(model, vx=-0.2)
    assert after(model, 13.0, 8.01).vx == pytest.approx(-0.2, rel=1e-3)
    hand(model, name, stamps[0], **fields)
    assert after(model, 18.0, 13.01).vx == pytest.approx(speed / len(stamps), rel=1e-3)
    hand(model, "opendlv.sim.Command", command="reset")
    assert after(model, 19.0, 18.01) == BodyMotion()


@pytest.mark.parametrize("drive", ["kiwi", "differential", "bicycle"])
def test_what_is_no_number_is_ignored_and_no_drive_moves_sideways(drive: str, caplog: pytest.LogCaptureFixture) -> None:
    model = service(drive=drive)
    with caplog.at_level(logging.WARNING):
        for fields in ({"vx": math.nan}, {"vx": 1.0, "yawRate": math.inf}, {"vy": -math.inf}, {"vy": 0.5}, {"vy": 0.5}):
            hand(model, **fields)
    assert after(model, 1.0) == BodyMotion()
    assert [record.getMessage() for record in caplog.records] == [
        "ignored a GroundMotionRequest of nan, 0.0, 0.0",
        "ignored a GroundMotionRequest of 1.0, 0.0, inf",
        "ignored a GroundMotionRequest of 0.0, -inf, 0.0",
        "no drive moves sideways: vy of 0.5 m/s, and of all others, has no effect",
    ]
