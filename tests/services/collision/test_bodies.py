"""How close a vehicle comes to other bodies, against times sampled densely, and what is said of it."""

import math
from typing import Any

import pytest
import shapely
import shapely.affinity

from dodo_dsl.opendlv.assets.track import Track, VehicleBox, VehiclePose, between, outline
from services.base import UnjudgeableError, Verdict
from services.collision.bodies import OtherBody, least_distance
from services.collision.model import TrackEvaluator

BOX = VehicleBox(0.36, 0.16)
TRIANGLE = shapely.Polygon([(0.3, 0.0), (-0.2, 0.1), (-0.2, -0.1)])
BEGIN = 1_700_000_000_000_000


def sampled(own: tuple[VehiclePose, VehiclePose], its: tuple[VehiclePose, VehiclePose], count: int = 400) -> float:
    """The smallest distance at so many times."""
    shares = [n / count for n in range(count + 1)]
    return min(shapely.distance(outline(between(*own, share), BOX), placed(between(*its, share))) for share in shares)


def placed(pose: VehiclePose) -> shapely.Geometry:
    turned = shapely.affinity.rotate(TRIANGLE, pose.heading, origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turned, pose.x, pose.y)


MOVES = [
    ((0, 0, 0), (1, 0, 0), (2, 0.5, math.pi), (0.5, 0.5, math.pi)),  # they pass each other
    ((0, 0, 0), (2, 0, 0), (1, -1, math.pi / 2), (1, 1, math.pi / 2)),  # they meet at a crossing
    ((0, 0, 0), (2, 0, 0), (1, -2.2, math.pi / 2), (1, -0.2, math.pi / 2)),  # one arrives there too late
    ((0, 0, 0), (0.5, 0.1, 0.6), (0.7, -0.3, 3), (0.9, -0.5, -2.5)),  # both turn
    ((0, 0, 0), (0, 0, 3), (0.45, 0.1, 0), (0.45, 0.1, 0)),  # one turns on the spot
]


@pytest.mark.parametrize("poses", MOVES)
def test_the_distance_is_that_of_both_at_one_time(poses: tuple[tuple[float, float, float], ...]) -> None:
    own, its = [tuple(VehiclePose(*pose) for pose in poses[begin : begin + 2]) for begin in (0, 2)]
    found = least_distance(own, its, BOX, TRIANGLE)  # type: ignore[arg-type]
    expected = sampled(own, its)  # type: ignore[arg-type]
    assert expected - 1.5e-3 <= found <= expected + 1e-9 + 2e-3 * (expected > 0)


class Drive:
    """The evaluator, with one body at stamp 7; both send a frame every 10 ms unless something else is said."""

    def __init__(self, margin: float = 0.0) -> None:
        finish = {"finish": shapely.MultiLineString([[(5, -1), (5, 1)]])}
        track = Track({}, finish, 10.0, min_body_margin=margin)
        self.judge = TrackEvaluator(track, BOX, bodies={7: ("kiwi-2", TRIANGLE)})
        self.judge.update(BEGIN)
        self.judge.begin(BEGIN)

    def own(self, time: float, x: float, y: float = 0.0) -> None:
        self.judge.look(VehiclePose(x, y, 0.0), BEGIN + round(time * 1e6))

    def its(self, time: float, x: float, y: float = 0.0, heading: float = 0.0) -> None:
        self.judge.look_at_body(7, VehiclePose(x, y, heading), BEGIN + round(time * 1e6))

    def request(self) -> None:
        for name in ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"):
            self.judge.request(name)

    @property
    def verdict(self) -> Verdict | None:
        return self.judge.verdict


def checks(verdict: Verdict | None) -> dict[str, Any]:
    assert verdict is not None
    return {check.name: (check.value, check.ok) for check in verdict.checks}


def test_a_body_that_is_hit_is_named() -> None:
    drive = Drive()
    for n in range(200):
        drive.its(n / 100, 2.0)
        drive.own(n / 100, n / 100)
        if drive.verdict:
            break
    verdict = drive.verdict
    assert verdict is not None and verdict.outcome == "failed"
    assert verdict.reason == "hit body kiwi-2 after 1.62 s at x = 1.62 m, y = 0.00 m"
    assert verdict.evidence["obstacle"] == verdict.evidence["closest-body"] == "kiwi-2"
    assert checks(verdict)["body-margin"] == (0.0, False)
    (check,) = [check for check in verdict.checks if check.name == "body-margin"]
    assert (check.limit, check.exclusive, check.parameters) == ({"min": 0.0}, True, ("min-body-margin", "bodies"))


def test_following_is_judged_by_the_distance_at_one_time() -> None:
    """Both at 1 m/s, the frames of the body ten times as rare, and late."""
    drive = Drive(margin=0.3)
    for n in range(100):
        drive.own(n / 100, n / 100)
        if n % 10 == 5:
            drive.its((n - 5) / 100, 1.0 + (n - 5) / 100)
    assert drive.verdict is None
    assert drive.judge._measures.body_margin == pytest.approx(1.0 - 0.2 - 0.18, abs=1e-9)


def test_the_goal_counts_only_when_no_body_was_hit_up_to_then() -> None:
    """A body whose newest frame is older counts as standing there."""
    for across, outcome in ((0.1, "failed"), (0.5, "passed")):
        drive = Drive()
        drive.its(0.0, 4.0, across)
        drive.own(0.0, 0.0)
        drive.request()
        drive.own(1.0, 5.0)
        assert drive.verdict is not None and drive.verdict.outcome == outcome, drive.verdict
    assert checks(drive.verdict)["body-margin"] == (pytest.approx(0.5 - 0.08 - 0.1), True)


def test_a_body_that_is_not_seen_or_begins_at_the_vehicle_is_no_verdict() -> None:
    drive = Drive()
    drive.own(0.0, 0.0)
    drive.request()
    with pytest.raises(
        UnjudgeableError, match=r"no opendlv\.sim\.Frame of body kiwi-2 came before the vehicle reached"
    ):
        drive.own(1.0, 5.0)
    drive = Drive()
    drive.own(0.0, 0.0)
    with pytest.raises(UnjudgeableError, match="body kiwi-2 touches the vehicle when it is first seen"):
        drive.its(0.0, 0.3)


def test_a_body_whose_frames_stop_stands_there() -> None:
    body = OtherBody("kiwi-2", TRIANGLE, BOX)
    body.take(BEGIN, VehiclePose(3, 0, 0))
    body.take_vehicle(BEGIN, VehiclePose(0, 0, 0))
    assert body.first() == pytest.approx(3 - 0.2 - 0.18)
    margins = []
    for n in range(1, 6):
        body.take_vehicle(BEGIN + n * 1_000_000, VehiclePose(n, 0, 0))
        margins += [margin for _, margin in body.approaches()]
    assert margins == pytest.approx([1.62, 0.62, 0.0, 0.0, 0.52])
