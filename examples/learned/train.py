"""Learn to steer from pairs of frames and steering: a linear function of what view.py sees (ridge regression).

python train.py drives model.npz, where each folder in drives has the frames and tables of dodo rec export
"""

import argparse
import csv
import sys
from bisect import bisect_left
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from view import view

STIFFNESS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Penalties on the size of the weights; the one that suits the validation part best is taken."""

Numbers = NDArray[np.float64]


PATIENCE = 200_000
"""us after a frame in which steering answers it."""
TABLE = "opendlv.proxy.GroundSteeringRequest-0.csv"


def read(folders: Sequence[Path]) -> tuple[Numbers, Numbers]:
    """What is seen (frames x numbers), and the steering (frames)."""
    views, angles = [], []
    for folder in folders:
        with (folder / TABLE).open(encoding="latin-1", newline="") as file:
            rows = list(csv.DictReader(file, delimiter=";"))
        times = [int(r["sampleTimeStamp.seconds"]) * 10**6 + int(r["sampleTimeStamp.microseconds"]) for r in rows]
        for picture in sorted(folder.glob("*-*.png")):
            time = int(picture.stem.split("-")[1])
            at = bisect_left(times, time)
            if at < len(times) and times[at] - time <= PATIENCE:
                views.append(view(cv2.imread(str(picture))))
                angles.append(float(rows[at]["groundSteering"]))
    return np.array(views), np.array(angles)


def fitted(views: Numbers, angles: Numbers, stiffness: float) -> Numbers:
    """The weights with the least squared error and ``stiffness`` times their own squares."""
    square = views.T @ views + stiffness * np.eye(views.shape[1])
    return np.asarray(np.linalg.solve(square, views.T @ angles))


def error(views: Numbers, angles: Numbers, weights: Numbers) -> float:
    """Root of the mean squared error, rad."""
    return float(np.sqrt(((views @ weights - angles) ** 2).mean()))


def main() -> int:
    parser = argparse.ArgumentParser(description="Learn to steer from frames.")
    parser.add_argument("drives", type=Path, help="folder of folders with frames and tables")
    parser.add_argument("model", type=Path, help="file to be written, such as model.npz")
    flags = parser.parse_args()
    drives = sorted(flags.drives.iterdir())
    train, validation = read([one for number, one in enumerate(drives) if number % 5]), read(drives[::5])
    models = {one: fitted(*train, one) for one in STIFFNESS}
    best = min(models, key=lambda one: error(*validation, models[one]))
    weights = models[best]
    print(f"{len(train[1])} frames to learn from, {len(validation[1])} to validate")
    errors = [error(*part, weights) for part in (train, validation)]
    print(f"stiffness {best:g}: error {errors[0]:.4f} rad, of the validation {errors[1]:.4f} rad")
    print(f"steering straight on would be wrong by {np.sqrt((validation[1] ** 2).mean()):.4f} rad")
    part = flags.model.with_name(flags.model.name + ".part.npz")
    np.savez(part, weights=weights)
    part.replace(flags.model)
    return 0


if __name__ == "__main__":
    sys.exit(main())
