"""Errors of estimated poses: pairs by time, alignment, absolute and relative errors, as ``evo`` defines them.

Times are in us, positions in m, angles in degrees.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.attitude import rotation_of

Times = NDArray[np.int64]
Values = NDArray[np.float64]
_LINE = 1e-10
"""Share of the variance along a way below which there is none across it."""


class Poses(NamedTuple):
    """Positions (n x 3) and rotations (n x 3 x 3) from the body to the world."""

    positions: Values
    rotations: Values

    def moved(self, rotation: Values, translation: Values) -> "Poses":
        """All of them in another frame."""
        turned = np.einsum("ij,njk->nik", rotation, self.rotations)
        return Poses(np.einsum("ij,nj->ni", rotation, self.positions) + translation, turned)


def poses(rows: Values) -> Poses:
    """The poses of rows of x, y, z, qx, qy, qz and qw; a quaternion may have any length but none."""
    x, y, z, w = (rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)).T
    return Poses(rows[:, :3], np.moveaxis(np.array(rotation_of(x, y, z, w)), 2, 0))


def nearest(known: Times, times: Times, most: int) -> Times:
    """The number of the known time that is nearest to each, the earlier of two; -1 if it is more than ``most`` away."""
    after = np.clip(np.searchsorted(known, times), 0, len(known) - 1)
    before = np.maximum(after - 1, 0)
    number = np.where(np.abs(known[after] - times) < np.abs(times - known[before]), after, before)
    return np.where(np.abs(known[number] - times) <= most, number, -1)


def is_open(points: Values, others: Values) -> bool:
    """Whether they leave open how to turn points onto others, as those on a line do."""
    sizes = np.linalg.svd(_covariance(points, others), compute_uv=False)
    return bool(sizes[1] <= max(np.finfo(float).eps, _LINE * sizes[0]))


def moved_by_first(estimates: Poses, truth: Poses) -> Poses:
    """The estimates in a frame in which the first one is true."""
    rotation = truth.rotations[0] @ estimates.rotations[0].T
    return estimates.moved(rotation, truth.positions[0] - rotation @ estimates.positions[0])


def moved_by_all(estimates: Poses, truth: Poses) -> Poses:
    """The estimates moved so that the sum of squared distances is least (Umeyama 1991)."""
    left, _, right = np.linalg.svd(_covariance(truth.positions, estimates.positions))
    left[:, -1] *= np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation = left @ right
    return estimates.moved(rotation, truth.positions.mean(0) - rotation @ estimates.positions.mean(0))


def absolute(truth: Poses, estimates: Poses) -> tuple[Values, Values]:
    """Distance and angle of each estimate from its true pose."""
    turn = np.einsum("nji,njk->nik", truth.rotations, estimates.rotations)
    across = turn[:, (2, 0, 1), (1, 2, 0)] - turn[:, (1, 2, 0), (2, 0, 1)]
    angle = np.arctan2(np.linalg.norm(across, axis=1), np.einsum("nii->n", turn) - 1)
    return np.linalg.norm(estimates.positions - truth.positions, axis=1), np.degrees(angle)


def relative(truth: Poses, estimates: Poses, ends: Times) -> tuple[Values, Values]:
    """Errors of translation and rotation of the motions from each of ``ends`` to the next."""
    return absolute(_motions(truth, ends), _motions(estimates, ends))


def ends(steps: Iterable[float], delta: float) -> Times:
    """The first pose, and each that is ``delta`` or more after the one before, by the steps from pose to pose."""
    found, since = [0], 0.0
    for number, step in enumerate(steps, 1):
        since += step
        if since >= delta:
            found.append(number)
            since = 0.0
    return np.array(found)


def rmse(errors: Values) -> float:
    """The root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def _motions(path: Poses, ends: Times) -> Poses:
    back, step = path.rotations[ends[:-1]], path.positions[ends[1:]] - path.positions[ends[:-1]]
    return Poses(np.einsum("nji,nj->ni", back, step), np.einsum("nji,njk->nik", back, path.rotations[ends[1:]]))


def _covariance(first: Values, second: Values) -> Values:
    found: Values = np.einsum("ni,nj->ij", first - first.mean(0), second - second.mean(0)) / len(first)
    return found
