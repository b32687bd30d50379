"""Vehicles by velocity: what a GroundMotionRequest makes of each drive, against closed-form solutions."""

import logging
import math
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from services.base.flags import FlagsError
from services.dynamic_model.drives import GRAVITY
from services.dynamic_model.model import BodyMotion
from services.dynamic_model.service import DynamicModel
from tests.services.dynamic_model.test_service import AXLES, PEDALS, SPEED, STEER, service

MOTION = "opendlv.proxy.GroundMotionRequest"
SMALL = {"drive": "bicycle", "wheel-base": 0.3, "cg": 0.15, "steering-rate": 600, "speed-lag": 0.1}
WHEELS = {"drive": "differential", "motor-lag": 0}
DEG = math.radians(1)


def hand(model: DynamicModel, name: str, stamp: int | None = None, **fields: float) -> None:
    model.inputs[name, stamp](MessageSet.standard().type(name)(**fields), 0)


def after(model: DynamicModel, end: float, begin: float = 0.0) -> BodyMotion:
    """The motion at the end, in s, of steps of 10 ms."""
    for now in range(round(begin * 100), round(end * 100) + 1):
        model.update(now * 10_000)
    return model.vehicle.motion


@pytest.mark.parametrize("flags", [{"drive": "differential"}, SMALL, {**SMALL, "tyres": "dynamic"}, {}], ids=str)
@pytest.mark.parametrize(
    ("vx", "yaw_rate"), [(0.5, 0.0), (0.6, 0.8), (0.6, -0.8), (-0.5, 0.0), (-0.4, 0.5), (0.0, 0.0)]
)
def test_the_body_moves_as_it_is_asked(flags: dict[str, Any], vx: float, yaw_rate: float) -> None:
    """Straight, on arcs of the radius v/w, in reverse, and not at all; vy is what the drive has beside it."""
    model = service(**flags)
    hand(model, MOTION, vx=vx, yawRate=yaw_rate)
    motion = after(model, 4.0)
    assert (motion.vx, motion.yaw_rate) == pytest.approx((vx, yaw_rate), abs=2e-3)


def test_two_wheels_turn_in_place_and_a_car_that_steers_does_not() -> None:
    for flags, turned in (({"drive": "differential"}, 1.5), (SMALL, 0.0), ({}, 0.0)):
        model = service(**flags)
        hand(model, MOTION, yawRate=1.5)
        motion = after(model, 3.0)
        assert (motion.vx, motion.yaw_rate) == pytest.approx((0.0, turned), abs=1e-9)


@pytest.mark.parametrize(
    ("flags", "vx", "yaw_rate", "expected"),
    [
        (WHEELS, 2.0, 0.0, (0.7, 0.0)),
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
    hand(model, MOTION, vx=vx, yawRate=yaw_rate)
    motion = after(model, 5.0)
    assert (motion.vx, motion.yaw_rate) == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_wheels_that_slip_turn_as_fast_as_without() -> None:
    model = service(**WHEELS, slip=0.3, odometry="true")
    hand(model, MOTION, vx=0.5)
    after(model, 1.0)
    assert [r.value for r in model.vehicle.odometry] == pytest.approx([0.5 / 0.0325] * 2)


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ({}, 0.5),
        ({"max-acceleration": 0.9}, 0.9 * 0.2),
        ({"motor-lag": 0.1}, 0.5 * -math.expm1(-2.0)),
        ({"friction": 0.1}, 0.1 * GRAVITY * 0.2),
        ({"latency": 0.15}, 0.05 * GRAVITY),
        ({"latency": 0.15, "max-acceleration": 0.9}, 0.9 * 0.05),
        ({"latency": 0.25}, 0.0),
    ],
)
def test_dead_time_and_acceleration(flags: dict[str, Any], expected: float) -> None:
    """Speed 0.2 s after 0.5 m/s was asked for."""
    model = service(**{**WHEELS, **flags})
    model.update(0)
    hand(model, MOTION, vx=0.5)
    assert after(model, 0.2, 0.01).vx == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("flags", "own", "speed"),
    [
        ({"drive": "differential"}, [(PEDALS, 0, {"position": 0.525}), (PEDALS, 1, {"position": 0.525})], 0.455),
        (
            {"drive": "differential", "wheel-input": "axle"},
            [(AXLES, n, {"axleAngularVelocity": 10.0}) for n in (0, 1)],
            0.325,
        ),
        ({**SMALL}, [(SPEED, None, {"groundSpeed": 0.6}), (STEER, None, {"groundSteering": 0.0})], 0.6),
        ({}, [(PEDALS, None, {"position": 0.1})], 0.65),
    ],
)
@pytest.mark.parametrize("latency", [0.0, 0.1])
def test_the_last_kind_of_request_counts(
    flags: dict[str, Any], own: list[tuple[str, int | None, dict[str, float]]], speed: float, latency: float
) -> None:
    model = service(**flags, latency=latency)
    model.update(0)
    hand(model, MOTION, vx=0.3, yawRate=0.5)
    assert after(model, 3.0, 0.01).vx == pytest.approx(0.3, rel=1e-3)
    for name, stamp, fields in own:
        hand(model, name, stamp, **fields)
    motion = after(model, 8.0, 3.01)
    assert (motion.vx, motion.yaw_rate) == pytest.approx((speed, 0.0), rel=1e-3, abs=1e-6)
    hand(model, MOTION, vx=-0.2)
    assert after(model, 13.0, 8.01).vx == pytest.approx(-0.2, rel=1e-3)
    hand(model, *own[0][:2], **own[0][2])  # of two wheels the left one alone
    wheels = sum(stamp is not None for _, stamp, _ in own)
    assert after(model, 18.0, 13.01).vx == pytest.approx(speed / max(wheels, 1), rel=1e-3)
    model.inputs["opendlv.sim.Command", None](MessageSet.standard().type("opendlv.sim.Command")(command="reset"), 0)
    assert after(model, 19.0, 18.01) == BodyMotion()


@pytest.mark.parametrize("drive", ["kiwi", "differential", "bicycle"])
def test_what_is_no_number_is_ignored_and_no_drive_moves_sideways(drive: str, caplog: pytest.LogCaptureFixture) -> None:
    model = service(drive=drive)
    with caplog.at_level(logging.WARNING):
        for fields in ({"vx": math.nan}, {"vx": 1.0, "yawRate": math.inf}, {"vy": -math.inf}):
            hand(model, MOTION, **fields)
        assert after(model, 1.0) == BodyMotion()
        for _ in range(2):
            hand(model, MOTION, vy=0.5)
    assert after(model, 2.0, 1.01) == BodyMotion()
    assert [record.getMessage() for record in caplog.records] == [
        "ignored a GroundMotionRequest of nan, 0.0, 0.0",
        "ignored a GroundMotionRequest of 1.0, 0.0, inf",
        "ignored a GroundMotionRequest of 0.0, -inf, 0.0",
        "no drive moves sideways: vy of 0.5 m/s, and of all others, has no effect",
    ]


@pytest.mark.parametrize("flag", ["slip", "max-speed", "max-yaw-rate"])
def test_limits_are_of_two_wheels(flag: str) -> None:
    with pytest.raises(FlagsError, match=f"^--{flag} is for --drive=differential$"):
        service(drive="bicycle", **{flag: 0.5})


def test_a_bicycle_accelerates_as_before_unless_it_says_otherwise() -> None:
    for flags, expected in (({}, 3.5), ({"max-acceleration": 1}, 1.0)):
        model = service(drive="bicycle", **flags)
        model.update(0)
        hand(model, MOTION, vx=30.0)
        assert after(model, 2.0, 0.01).vx == pytest.approx(2 * expected, rel=1e-6)
