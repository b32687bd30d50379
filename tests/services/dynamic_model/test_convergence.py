"""The model against scipy's solver on the equations written down once more, from the published ones."""

import math
from itertools import pairwise

import pytest
from scipy.integrate import solve_ivp

from services.dynamic_model.model import BodyMotion, Vehicle

MASS, INERTIA, FRONT, REAR, STIFFNESS = 1.113, 0.01, 0.12, 0.104, 15.0
SECONDS = 2.0


def equations(wheel: float, force: float):  # type: ignore[no-untyped-def]
    def derivative(_t: float, state: tuple[float, float, float]) -> list[float]:
        vx, vy, r = state
        alpha_f = wheel - (vy + FRONT * r) / abs(vx)
        alpha_r = (REAR * r - vy) / abs(vx)
        return [
            (force - 4 * vx) / MASS,
            STIFFNESS * (alpha_f + alpha_r) / MASS - vx * r,
            STIFFNESS * (FRONT * alpha_f - REAR * alpha_r) / INERTIA,
        ]

    return derivative


def solved(start: BodyMotion, steering: float, force: float) -> list[float]:
    """By LSODA, which changes to implicit steps where the equations are stiff."""
    wheel = steering * 0.6 / 0.290888
    state = (start.vx, start.vy, start.yaw_rate)
    result = solve_ivp(equations(wheel, force), (0, SECONDS), state, method="LSODA", rtol=1e-11, atol=1e-13)
    return [float(values[-1]) for values in result.y]


def driven(start: BodyMotion, steering: float, pedal: float, steps: int) -> list[float]:
    vehicle = Vehicle(100, steps=steps)
    vehicle.motion = start
    vehicle.steer(steering)
    vehicle.press(pedal)
    for now in range(0, int(SECONDS * 1e6) + 1, 10_000):
        vehicle.update(now)
    return [vehicle.motion.vx, vehicle.motion.vy, vehicle.motion.yaw_rate]


@pytest.mark.parametrize(
    ("start", "steering", "pedal", "force"),
    [
        (BodyMotion(0.5), 0.1, 0.14, 26 * 0.14),
        (BodyMotion(0.9, 0.05, -1.0), -0.2, 0.1, 26 * 0.1),
        (BodyMotion(-0.3), 0.15, -0.5, -5 * 0.5),
        (BodyMotion(0.8, 0.1, 2.0), 0.0, 0.05, 26 * 0.05),
    ],
)
def test_the_error_goes_down_as_the_steps_do(start: BodyMotion, steering: float, pedal: float, force: float) -> None:
    exact = solved(start, steering, force)
    errors = [math.dist(driven(start, steering, pedal, steps), exact) for steps in (1, 2, 4, 8, 16, 100)]
    for coarse, fine in pairwise(errors[1:5]):
        assert coarse / fine == pytest.approx(2, rel=0.1)  # Euler's order is one
    assert errors[0] < 0.02
    assert errors[-1] < 1.5e-4
