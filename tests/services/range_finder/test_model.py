"""What range sensors say of true distances: cones, poses, blind zones, curves, errors."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.range_finder.model import Curve, Device, RangeFinder, Sensor
from services.scene.outlines import Cut, Outlines, Place

KIWI = "3.0,0.04;1.6,0.078;1.0,0.13;0.6,0.22;0.3,0.4"
INFRARED = Device(near=0.04, far=0.4, curve=Curve.parse(KIWI))
NO_ERRORS = 0.0, 0.5, 0.5
ORIGIN = Place(0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def room(write_map):
    """A room of 4 m by 6 m around the origin, and a post ahead on the left."""
    walls = [[-2, -3, 2, -3], [2, -3, 2, 3], [2, 3, -2, 3], [-2, 3, -2, -3]]
    post = {"name": "post", "dimension": [0.1, 0.1, 1], "color": [1, 0, 0], "instances": [[1, 0.3, 0.5, 0]]}
    return Outlines(write_map({"block": [post], "obstacles": [{"name": "walls", "lines": walls}]}), ["walls"])


def seen(room, device, place=ORIGIN, **mounted):
    return RangeFinder(room, [Sensor(0, **mounted)], device).distances(place, {})[0]


def test_a_cone_hears_what_a_ray_passes_by(room):
    ray = Device()
    assert seen(room, ray) == pytest.approx(2.0)
    assert seen(room, ray, yaw=math.atan2(0.3, 1.0)) == pytest.approx(0.95 * math.hypot(1, 0.3))
    wide = seen(room, Device(cone=math.radians(55), rays=201))
    assert wide == pytest.approx(math.hypot(0.95, 0.25), rel=2e-3), "the post's nearest corner"
    whole = seen(room, Device(cone=math.radians(55)))
    assert whole == pytest.approx(math.hypot(0.95, 0.25)), "and so without rays"
    for rays in (None, 201):
        assert seen(room, Device(cone=math.radians(20), rays=rays)) == pytest.approx(2.0), "it is outside the cone"
    assert seen(room, Device(cone=math.radians(55), rays=2)) > 1.0, "it is between the rays"


@given(st.floats(-1.5, 0.5), st.floats(-2.5, -0.5), st.floats(-math.pi, math.pi), st.sampled_from([0, 90, 180, 270]))
def test_a_sensor_is_where_the_vehicle_carries_it(x, y, yaw, side):
    """In a room with nothing else, the distance to the wall ahead is that of geometry."""
    corners = np.array([[-2.0, -3.0], [2.0, -3.0], [2.0, 3.0], [-2.0, 3.0]])
    cut = Cut.of([(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), False)])

    class Room:
        def at(self, height):
            return cut

        def bodies_at(self, height, places):
            return []

    sensor = Sensor(0, x=0.2, y=-0.1, yaw=math.radians(side))
    found = RangeFinder(Room(), [sensor], Device(far=99.0)).distances(Place(x, y, 0.0, yaw), {})[0]
    ox, oy = x + 0.2 * math.cos(yaw) + 0.1 * math.sin(yaw), y + 0.2 * math.sin(yaw) - 0.1 * math.cos(yaw)
    ux, uy = math.cos(yaw + sensor.yaw), math.sin(yaw + sensor.yaw)
    exits = [(math.copysign(2, ux) - ox) / ux if ux else math.inf, (math.copysign(3, uy) - oy) / uy if uy else math.inf]
    assert found == pytest.approx(min(exits), rel=1e-9)


def test_the_range_of_an_ultrasonic_sensor():
    device = Device()
    assert [device.reading(d, NO_ERRORS) for d in (0.01, 0.03, 1.0, 6.0)] == [0.03, 0.03, 1.0, 6.0]
    assert device.reading(math.inf, NO_ERRORS) == 6.0
    assert replace(device, beyond="zero").reading(math.inf, NO_ERRORS) == 0.0
    assert replace(device, beyond="silence").reading(math.inf, NO_ERRORS) is None


def test_the_voltage_of_an_infrared_sensor():
    device = replace(INFRARED, in_volts=True)
    assert [device.reading(d, NO_ERRORS) for d in (0.04, 0.078, 0.175, 0.4)] == pytest.approx([3.0, 1.6, 0.8, 0.3])
    assert device.reading(0.02, NO_ERRORS) == pytest.approx(1.5), "too near: it falls again"
    assert device.reading(0.0, NO_ERRORS) == 0.0
    assert device.reading(math.inf, NO_ERRORS) == pytest.approx(0.3)
    assert replace(device, far=0.8).reading(0.6, NO_ERRORS) == pytest.approx(0.2)


@pytest.mark.parametrize(
    "text", ["", "3.0", "3,0.1", "1,0.1;2,0.2", "2,0.2;1,0.1", "2,0;1,1", "nan,1;1,2", "2,1;2,3", "a,b"]
)
def test_a_curve_falls(text):
    with pytest.raises(ValueError):
        Curve.parse(text)
