"""The heading of a body by its attitude."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.attitude import heading_of


@given(st.floats(-math.pi + 1e-6, math.pi), st.floats(0.01, 100))
def test_heading_of_a_quaternion_of_any_length(heading: float, length: float) -> None:
    qz, qw = length * math.sin(heading / 2), length * math.cos(heading / 2)
    found = heading_of(0, 0, qz, qw)
    assert found is not None
    assert math.remainder(found - heading, math.tau) == pytest.approx(0, abs=1e-9)


def test_heading_of_a_pitched_body_is_where_its_nose_points_on_the_ground() -> None:
    yaw, pitch = 0.8, 0.5
    cy, sy, cp, sp = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    assert heading_of(-sp * sy, sp * cy, cp * sy, cp * cy) == pytest.approx(0.8)


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (0, 0, math.inf, 1)])
def test_no_heading_without_an_attitude(q: tuple[float, float, float, float]) -> None:
    assert heading_of(*q) is None
