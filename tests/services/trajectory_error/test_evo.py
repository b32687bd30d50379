"""The errors against evo's: what it printed for a drive, and its functions where it is installed.

evo is no dependency: it has the GPL, and 200 MB come with it (pandas, matplotlib, seaborn). Figures are of evo 1.38.1:

    python -m tests.services.trajectory_error.trajectories .
    evo_ape tum truth.tum estimates.tum -r trans_part                # and angle_deg; --align_origin, -a
    evo_rpe tum truth.tum estimates.tum -r trans_part -d 10 -u f     # and angle_deg; -d 1, -u m
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.trajectory_error import model
from services.trajectory_error.model import Values
from tests.services.trajectory_error.test_service import decided, values
from tests.services.trajectory_error.trajectories import Trajectory, estimates, truth

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


def of_evo(trajectory: Trajectory) -> Any:
    evo = pytest.importorskip("evo.core.trajectory")
    times, rows = trajectory
    return evo.PoseTrajectory3D(rows[:, :3], rows[:, [6, 3, 4, 5]], times / 1e6)


@st.composite
def drives(draw: st.DrawFn) -> tuple[Trajectory, Trajectory]:
    """A true way, and fewer estimates anywhere in its time and around; no time is as near to two true poses."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    known = np.unique(random.integers(0, 1_000_000, draw(st.integers(60, 200)))) * 4
    times = np.unique(random.integers(-50_000, 2_050_000, draw(st.integers(4, 40)))) * 2 + 1
    scale = draw(st.sampled_from([1e-3, 1.0, 1e3]))
    way = np.cumsum(random.normal(0, scale, (len(known), 3)), axis=0)
    turns = np.cumsum(random.normal(0, 0.3, (len(known), 4)), axis=0)
    at = np.clip(np.searchsorted(known, times), 0, len(known) - 1)
    guesses = np.hstack([way[at], turns[at]]) + random.normal(0, 0.1, (len(times), 7)) * ([scale] * 3 + [1] * 4)
    return (known, np.hstack([way, turns])), (times, guesses)


@given(drives(), st.sampled_from(["none", "origin", "se3"]), st.sampled_from([1, 3, 0.5, 4.0]))
def test_pairs_alignment_and_errors_are_those_of_evo(
    drive: tuple[Trajectory, Trajectory], align: str, delta: float
) -> None:
    """A delta that is no whole number is in steps of usual length."""
    metrics, sync = (pytest.importorskip(f"evo.core.{name}") for name in ("metrics", "sync"))
    (known, rows), (times, guesses) = drive
    number = model.nearest(known, times, 20_000)
    if (number >= 0).sum() < 4:
        return
    ref, est = sync.associate_trajectories(*map(of_evo, drive), max_diff=0.02)
    true, moved = model.poses(rows[number[number >= 0]]), model.poses(guesses[number >= 0])
    if align == "origin":
        est.align_origin(ref)
        moved = model.moved_by_first(moved, true)
    elif align == "se3":
        est.align(ref)
        moved = model.moved_by_all(moved, true)
    steps: Values = np.linalg.norm(np.diff(moved.positions, axis=0), axis=1)
    unit, least = metrics.Unit.meters, delta * float(np.median(steps))
    if isinstance(delta, int):
        steps, unit, least = np.ones(len(steps)), metrics.Unit.frames, delta
    ends, near = model.ends(steps.tolist(), least), {"abs": 1e-9 * float(np.abs(rows[:, :3]).max()) + 1e-6}
    relations = metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_deg
    found = zip(relations, model.absolute(true, moved), model.relative(true, moved, ends), strict=True)
    for relation, away, apart in found:
        absolute, relative = metrics.APE(relation), metrics.RPE(relation, least, unit)
        absolute.process_data((ref, est))
        assert away == pytest.approx(absolute.error, **near)
        assert model.rmse(away) == pytest.approx(absolute.get_statistic(metrics.StatisticsType.rmse), **near)
        if len(ends) > 1:
            relative.process_data((ref, est))
            assert apart == pytest.approx(relative.error, **near)


@given(st.integers(0, 2**32))
def test_points_on_a_line_leave_open_how_they_are_turned(seed: int) -> None:
    points, others = np.random.default_rng(seed).normal(0, 2, (2, 12, 3))
    assert not model.is_open(points, others)
    assert model.is_open(points[:1] + np.arange(12)[:, np.newaxis] * points[1], others)
