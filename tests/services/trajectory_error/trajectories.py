"""True poses of a drive and estimates of it, and both as files for ``evo``.

python -m tests.services.trajectory_error.trajectories FOLDER
"""

import math
import sys
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.attitude import quaternion
from services.trajectory_error.model import Times, Values

Trajectory = tuple[Times, Values]
"""Times in us with rows of x, y, z and a quaternion."""


def truth() -> Trajectory:
    """A drive of 12 s along an eight that climbs, 100 Hz, in single precision as frames have it."""
    times, rows = np.arange(0, 12_000_000, 10_000), []
    for t in (times / 1e6).tolist():
        yaw = math.atan2(math.cos(t), math.cos(t / 2) / 2 + 0.1)
        turned = quaternion(0.1 * math.sin(t), 0.2 * math.cos(2 * t), yaw)
        rows.append([math.sin(t / 2) + 0.1 * t, math.sin(t), 0.3 * t, *turned])
    return times, np.array(rows, np.float32).astype(np.float64)


def estimates() -> Trajectory:
    """Of each 13th true pose, up to 4 ms before or after it: shaken, drifting, in a frame that is moved and turned."""
    times, rows = (each[7::13].copy() for each in truth())
    shaken = np.sin(np.arange(1, 6)[:, np.newaxis] * 7.3 * np.arange(len(times)) ** 2)
    for number, row in enumerate(rows):
        drift, (x, y) = 0.002 * number, row[:2]
        row[:2] = x * math.cos(0.3) - y * math.sin(0.3), x * math.sin(0.3) + y * math.cos(0.3)
        row[:3] += np.array([0.3 + drift, -drift, 0.0]) + 0.02 * shaken[:3, number]
        *_, z, w = quaternion(0, 0, 0.3 + drift + 0.01 * shaken[3, number])
        row[3:] = w * row[3:] + z * np.array([-row[4], row[3], row[6], -row[5]])
    return times + (4000 * shaken[4]).astype(np.int64), rows


if __name__ == "__main__":
    for name, (times, rows) in {"truth": truth(), "estimates": estimates()}.items():
        np.savetxt(Path(sys.argv[1]) / f"{name}.tum", np.column_stack([times / 1e6, rows]), "%.17g")
