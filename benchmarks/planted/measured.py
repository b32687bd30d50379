"""How many drives find the bugs of bugs.py, by margins that real drives of the good program had.

    python benchmarks/planted/programs.py none --most 300
    python benchmarks/planted/measured.py [--drives build/planted/none-0/dodo-report/search/planted/search.journal]

A drive in a bug's corner fails; elsewhere its margin is interpolated between the measured ones. So many seeds and
random drives are compared without thousands of drives. What a bug with an onset changes outside its corner is left
out, which makes it harder to find than programs.py does.
"""

import json
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from bugs import BUGS, RANGES, UNITS  # noqa: E402
from functions import FAILED, Bug, options, print_table  # noqa: E402
from programs import ROOT  # noqa: E402

NAMES = list(RANGES)
STORE = ROOT / "build/planted/none-0/dodo-report/search/planted/search.journal"


@dataclass(frozen=True)
class Measured(Bug):
    """A bug whose ``interpolated`` margin, of shares of the ranges, is that of the good program."""

    interpolated: Callable[[Any], Any]

    def margin(self, point: list[float]) -> float:
        if all(low <= point[one] <= high for one, (low, high) in self.trigger.items()):
            return FAILED
        return float(self.interpolated(np.array([point]))[0])


def measured(store: Path) -> tuple[Any, Any]:
    """Points, as shares of the ranges in the order of NAMES, and margins of the drives in a search's file."""
    name = "planted main"
    trials = optuna.load_study(study_name=name, storage=JournalStorage(JournalFileBackend(str(store)))).trials
    rows = [(one.user_attrs["point"], one.value) for one in trials if one.value is not None]
    points = []
    for text, _ in rows:
        values = {name.upper(): float(value.rstrip(UNITS)) for name, value in json.loads(text).items()}
        points.append([(values[name] - low) / (high - low) for name, (low, high) in RANGES.items()])
    return np.array(points), np.array([margin for _, margin in rows])


def interpolation(points: Any, margins: Any) -> Callable[[Any], Any]:
    from scipy.interpolate import RBFInterpolator

    return RBFInterpolator(points, margins, kernel="linear", smoothing=1e-3)


def error(points: Any, margins: Any) -> float:
    """The mean error of margins that were left out of the interpolation, a fifth at a time."""
    found: list[float] = []
    for part in range(5):
        out = np.arange(len(points)) % 5 == part
        found += abs(interpolation(points[~out], margins[~out])(points[out]) - margins[out]).tolist()
    return statistics.mean(found)


def main() -> None:
    parser = options()
    parser.add_argument("--drives", type=Path, default=STORE)
    parser.add_argument("bugs", nargs="*", metavar="BUG", help="of bugs.py (default: all)")
    flags = parser.parse_args()
    if not flags.drives.is_file():
        parser.error(f"{flags.drives} is missing: run programs.py none --most 300 first")
    points, margins = measured(flags.drives)
    good = interpolation(points, margins)
    spread = f"{margins.min():.3f} to {margins.max():.3f}, deviation {margins.std():.3f}"
    print(f"{len(points)} drives, margins {spread}, mean error of the interpolation {error(points, margins):.3f}")
    print_table((stand_in(name, good) for name in flags.bugs or BUGS), flags)


def stand_in(name: str, good: Callable[[Any], Any]) -> Measured:
    trigger = {NAMES.index(one): limits for one, limits in BUGS[name].corner.items()}
    return Measured(name, len(NAMES), trigger, {}, good)


if __name__ == "__main__":
    main()
