"""Manifests name the checks of their evaluators, with their units: what goals may name."""

from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path

import shapely
import yaml

from dodo_dsl.opendlv.assets.track import Track
from services.base import Check
from services.collision.model import DriveMeasures, Requests
from services.continuous_signal.measures import SignalMeasures
from services.object_detection.score import Counts, CountsByClass, Score
from tests.services.built import built
from tests.services.continuous_signal.test_model import limits
from tests.services.object_detection.test_model import flags

SERVICES = Path(__file__).parents[2] / "services"


def patterns(service: str) -> dict[str, str]:
    found: dict[str, str] = yaml.safe_load((SERVICES / service / "service.yml").read_text())["checks"]
    return found


def compare(service: str, checks: Iterable[Check]) -> None:
    """Each check is of one pattern, with its unit, and each pattern is of a check."""
    units = patterns(service)
    used = set()
    for check in checks:
        (pattern,) = (pattern for pattern in units if fnmatchcase(check.name, pattern))
        assert units[pattern] == check.unit, check.name
        used.add(pattern)
    assert used == set(units)


def test_collision() -> None:
    point = {"it": shapely.Point(0, 0)}
    track = Track(point, point, 1.0, gates=(("gate", shapely.MultiLineString()),))
    drive = DriveMeasures().checks(track, 0, 0.0, has_bodies=True)
    compare("collision", (*drive, *Requests(max_silence=2.0).checks()))


def test_continuous_signal() -> None:
    asked = limits(band=1.0, max_lag=1.0, max_repeats=3, max_gap=1, min_frame_share=0.5, min_sign_share=0.5)
    compare("continuous_signal", (*SignalMeasures(0, 0, 0, ()).checks(asked), Check("late", 0)))


def test_coverage() -> None:
    with built("coverage", "--x-min=0", "--x-max=1", "--y-min=0", "--y-max=1") as judge:
        compare("coverage", judge._verdict("failed", "").checks)


def test_responds() -> None:
    with built("responds", "--message=opendlv.proxy.GroundSteeringRequest", "--field=groundSteering",
               "--freq=1", "--min=0", "--max=1") as judge:  # fmt: skip
        compare("responds", judge.checks(1, 1))


def test_object_detection() -> None:
    score = Score(CountsByClass({"yellow": Counts(1)}))
    compare("object_detection", score.checks(flags()))


def test_trajectory_error() -> None:
    with built("trajectory_error", "--max-ate=1") as judge:
        compare("trajectory_error", judge.checks({}))
