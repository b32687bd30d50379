"""Which recordings of a data set are for training, and which for validation."""

import random
from collections.abc import Sequence
from pathlib import Path

TRAIN, VALIDATION = "train", "validation"


class SplitError(ValueError):
    """Recordings that cannot be split; one sentence."""


def split(files: Sequence[Path], share: float, seed: int) -> dict[str, list[Path]]:
    """The files by part, in their order; all in one part with the name "" where ``share`` is 0.

    Whole recordings are chosen, as frames of one drive are alike; the same ones for the same number of files and seed.
    Raises SplitError for fewer than two.
    """
    if not share:
        return {"": list(files)}
    if len(files) < 2:
        raise SplitError("--validation needs two recordings or more, as frames of one drive are alike")
    count = min(max(round(share * len(files)), 1), len(files) - 1)
    chosen = set(random.Random(seed).sample(range(len(files)), count))  # noqa: S311  (repeatable, not secret)
    parts = {TRAIN: [n for n in range(len(files)) if n not in chosen], VALIDATION: sorted(chosen)}
    return {name: [files[number] for number in numbers] for name, numbers in parts.items()}
