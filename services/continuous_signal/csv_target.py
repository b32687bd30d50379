"""A target from a CSV table."""

from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.inputs import target_table
from services.continuous_signal.target import Target


def read_table(path: Path, field: str, from_first: bool) -> Target:
    """The target in a table: the column named `field`, or else `value`, over `time`.

    Times count from zero, or `from_first` row on. Raises TargetError.
    """
    samples = target_table.read(path, field)
    times = np.array([time for time, _ in samples], np.int64)
    start = int(times[0]) if from_first else 0
    return Target(times - start, np.array([value for _, value in samples]), start)
