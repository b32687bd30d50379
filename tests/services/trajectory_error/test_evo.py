"""The errors against evo's: what it printed for a drive, and its functions where it is installed.

evo is no dependency: it has the GPL, and 200 MB come with it (pandas, matplotlib, seaborn). Figures are of evo 1.38.1:

    python -m tests.services.trajectory_error.trajectories .
    evo_ape tum truth.tum estimates.tum -r trans_part                # and angle_deg; --align_origin, -a
    evo_rpe tum truth.tum estimates.tum -r trans_part -d 10 -u f     # and angle_deg; -d 1, -u m
"""

import numpy as np
import pytest

from services.trajectory_error import model
from tests.services.trajectory_error.test_service import decided, values
from tests.services.trajectory_error.trajectories import estimates, truth

ABSOLUTE = {
    "none": {"ate": 0.475800, "mean": 0.427323, "error": 0.763289, "rotation": 22.582309, "rotation-error": 28.008940},
    "origin": {"ate": 0.151735, "mean": 0.132838, "error": 0.258831, "rotation": 6.028634, "rotation-error": 10.820206},
    "se3": {"ate": 0.048557, "mean": 0.044899, "error": 0.081898, "rotation": 5.976305, "rotation-error": 10.380678},
}
RELATIVE = {
    "1 frames": {"rpe": 0.036615, "rpe-rotation": 0.612418},
    "10 frames": {"rpe": 0.095406, "rpe-rotation": 1.339123},
    "1 m": {"rpe": 0.075257, "rpe-rotation": 1.127358},
}
FIELDS = ("x", "y", "z", "qx", "qy", "qz", "qw")


@pytest.mark.parametrize("align", ABSOLUTE)
@pytest.mark.parametrize("delta", RELATIVE)
def test_errors_are_those_that_evo_printed(align: str, delta: str) -> None:
    said, frames = (
        [
            (time / 1e6, time / 1e6, dict(zip(FIELDS, row.tolist(), strict=True)))
            for time, row in zip(*each, strict=True)
        ]
        for each in (estimates(), truth())
    )
    count, unit = delta.split()
    flags = ("--max-ate=1", f"--align={align}", f"--delta={count}", f"--delta-unit={unit}")
    found, expected = values(decided(flags, said, frames, end=12)), ABSOLUTE[align] | RELATIVE[delta]
    assert {name: found[name] for name in expected} == pytest.approx(expected, abs=6e-7)
    assert found["estimates"] == len(said)


def test_the_nearest_is_the_earlier_of_two_and_time_is_counted_from_pair_to_pair() -> None:
    found = model.nearest(np.array([0, 10, 30]), np.array([-10, -11, 5, 6, 20, 40, 41]), 10)
    assert found.tolist() == [0, -1, 0, 1, 1, 2, -1]
    steps = [100_000, 100_000, 100_000, 250_000, 50_000, 100_000, 100_000]
    assert model.ends(steps, 300_000).tolist() == [0, 3, 5] and model.ends([1] * 7, 3).tolist() == [0, 3, 6]
