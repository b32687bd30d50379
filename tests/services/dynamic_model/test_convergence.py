"""The model against scipy's solver on the equations written down once more, from the published ones."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from services.dynamic_model.model import PEDAL, STEERING, BodyMotion, KiwiDrive, Vehicle, limited, step

MASS, INERTIA, FRONT, REAR, STIFFNESS = 1.113, 0.01, 0.12, 0.104, 15.0
SECONDS, SLOWEST = 2.0, 0.1
TIMES = np.linspace(0, SECONDS, 201)


def wheel_angle(request: float) -> float:
    return limited(request * 0.6 / 0.290888, 0.6)


def equations(wheel: float, force: float):  # type: ignore[no-untyped-def]
    def derivative(_t: float, state: tuple[float, float, float]) -> list[float]:
        vx, vy, r = state
        if abs(vx) <= SLOWEST:
            return [(force - 4 * vx) / MASS, -1e4 * vy, -1e4 * r]
        alpha_f = wheel - (vy + FRONT * r) / abs(vx)
        alpha_r = (REAR * r - vy) / abs(vx)
        return [
            (force - 4 * vx) / MASS,
            STIFFNESS * (alpha_f + alpha_r) / MASS - vx * r,
            STIFFNESS * (FRONT * alpha_f - REAR * alpha_r) / INERTIA,
        ]

    return derivative


def solved(start: float, steering: float, pedal: float) -> np.ndarray:
    """By LSODA, which changes to implicit steps where the equations are stiff; rows of vx, vy and yaw rate."""
    force, state = (26 if pedal > 0 else 5) * pedal, (start, 0.0, 0.0)
    result = solve_ivp(
        equations(wheel_angle(steering), force),
        (0, SECONDS),
        state,
        "LSODA",
        TIMES,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.01,
    )
    return np.asarray(result.y)


def driven(start: float, steering: float, pedal: float, freq: int = 100) -> np.ndarray:
    vehicle = Vehicle(KiwiDrive())
    vehicle.motion = BodyMotion(start)
    vehicle.request(STEERING, steering)
    vehicle.request(PEDAL, pedal)
    motions = [vehicle.update(round(time * 1e6)) for time in TIMES[:: 100 // freq]]
    return np.array([(each.vx, each.vy, each.yaw_rate) for each in motions]).T


@pytest.mark.parametrize("steering", [0.05, -0.29])
@pytest.mark.parametrize(
    ("start", "pedal"),
    [
        *((speed, speed * 4 / 26) for speed in (0.05, 0.1001, 0.11, 0.13, 0.19, 0.3, 0.6, 0.91)),  # held
        *((-speed, -speed * 4 / 5) for speed in (0.05, 0.1001, 0.12, 0.18, 0.3, 0.6, 1.125)),
        (0.0, 0.14), (0.0, -0.9), (0.0, 0.016), (0.91, 0.0), (-1.125, 0.0), (0.91, -0.9), (-1.125, 0.14), (0.3, 0.0165),
    ],
)  # fmt: skip
def test_it_is_that_of_a_stiff_solver_at_every_speed(start: float, steering: float, pedal: float) -> None:
    exact, found = solved(start, steering, pedal), driven(start, steering, pedal)
    away, most = np.abs(found - exact), np.abs(exact).max(axis=1)
    assert away[0].max() < 2e-4
    turned = np.abs(np.cumsum(found - exact, axis=1) * 0.01)
    assert turned[2].max() < 2e-3 + 0.01 * most[2], "rad, of the heading: a step more or less where the tyres begin"
    settled = np.abs(exact[0]) > SLOWEST + 0.03
    assert away[1:, settled].max(initial=0) < 0.02 * most[1:].max() + 1e-6
    assert np.array_equal(driven(start, steering, pedal, 10), found[:, ::10]), "however seldom it is updated"


def test_the_error_goes_down_by_the_square_of_the_step() -> None:
    exact, errors = solved(0.5, 0.1, 0.14)[:, -101], []
    for count in (50, 100, 200, 400):
        motion = BodyMotion(0.5)
        for _ in range(2 * count):
            motion = step(motion, wheel_angle(0.1), 0.14, 0.5 / count)
        errors.append(math.dist((motion.vx, motion.vy, motion.yaw_rate), exact))
    assert [a / b for a, b in pairwise(errors)] == pytest.approx([4] * 3, rel=0.2)
