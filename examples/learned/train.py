"""Learn to steer from pairs of frames and steering: a linear function of what view.py sees (ridge regression).

dodo rec export dodo-report/*/test.rec --steering -o pairs --validation 20%
python train.py pairs model.npz
"""

import argparse
import csv
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from view import view

STIFFNESS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Penalties on the size of the weights; the one that suits the validation part best is taken."""

Numbers = NDArray[np.float64]


def read(folder: Path) -> tuple[Numbers, Numbers]:
    """What is seen (frames x numbers), and the steering (frames)."""
    views, angles = [], []
    with (folder / "steering.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            picture = cv2.imread(str(folder / row["picture"]))
            if picture is None:
                raise SystemExit(f"train: {folder / row['picture']} cannot be read")
            views.append(view(picture))
            angles.append(float(row["ground_steering_rad"]))
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
    parser.add_argument("pairs", type=Path, help="folder of dodo rec export --steering --validation")
    parser.add_argument("model", type=Path, help="file to be written, such as model.npz")
    flags = parser.parse_args()
    train, validation = read(flags.pairs / "train"), read(flags.pairs / "validation")
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
