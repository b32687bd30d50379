"""Manifests name the checks of their evaluators, with their units: what goals may name."""

from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path

import shapely
import yaml

from dodo_dsl.opendlv.assets.track import Track
from services.base import Check
from services.collision.model import DriveMeasures, Requests
from services.continuous_signal.measures import SignalLimits, SignalMeasures
from services.coverage.model import CoverageEvaluator, CoverageGrid, Footprint
from services.object_detection.score import Counts, CountsByClass, DetectionLimits, Score
from services.responds.model import ResponseEvaluator, ResponseLimits, at_rate
from tests.services.built import built

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
    limits = SignalLimits(band=1.0, lag=1.0, repeats=3, gap=1, frame_share=0.5, sign_share=0.5)
    compare("continuous_signal", (*SignalMeasures(0, 0, 0, ()).checks(limits), Check("late", 0)))


def test_coverage() -> None:
    grid = CoverageGrid(shapely.box(0, 0, 1, 1), 0.5, Footprint(1, 1))
    compare("coverage", CoverageEvaluator("a", grid, 0.5, 1).checks())


def test_responds() -> None:
    judge = ResponseEvaluator("a", "b", at_rate(1, 1), ResponseLimits(1, 1, 1, 1, low=0, high=1), 1)
    compare("responds", judge.checks(1, 1))


def test_object_detection() -> None:
    score = Score(CountsByClass({"yellow": Counts(1)}))
    compare("object_detection", score.checks(DetectionLimits()))


def test_trajectory_error() -> None:
    with built("trajectory_error", "--max-ate=1") as judge:
        compare("trajectory_error", judge.checks({}))
