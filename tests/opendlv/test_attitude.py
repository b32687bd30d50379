"""The heading of a body by its attitude."""

import math

import pytest

from dodo_dsl.opendlv.attitude import heading_of


def test_heading_of_a_pitched_body_is_where_its_nose_points_on_the_ground() -> None:
    yaw, pitch = 0.8, 0.5
    cy, sy, cp, sp = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    assert heading_of(-sp * sy, sp * cy, cp * sy, cp * cy) == pytest.approx(0.8)


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (0, 0, math.inf, 1)])
def test_no_heading_without_an_attitude(q: tuple[float, float, float, float]) -> None:
    assert heading_of(*q) is None
