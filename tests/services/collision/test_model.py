import base64
import json
import math
from array import array
from collections.abc import Iterable
from dataclasses import replace

import pytest
import shapely
import shapely.affinity

from dodo_dsl.opendlv.assets.track import Track, VehicleBox, VehiclePose
from services.base import UnjudgeableError, Verdict
from services.collision.model import REQUESTS, Requests, TrackEvaluator

SECOND = 1_000_000
BEGIN = 7_000 * SECOND


def line(*numbers: float) -> shapely.MultiLineString:
    return shapely.MultiLineString([[numbers[:2], numbers[2:]]])


LANE = Track(
    walls={"left": line(-1, 0.2, 5, 0.2), "right": line(-1, -0.2, 5, -0.2)},
    goal={"finish": line(3, -0.2, 3, 0.2)},
    max_time=40.0,
)


def judge(track: Track = LANE, requests: Iterable[str] = REQUESTS) -> TrackEvaluator:
    """A judge whose test has begun and who has heard the application."""
    it = TrackEvaluator(track, VehicleBox(0.36, 0.16))
    it.update(BEGIN - SECOND)
    it.begin(BEGIN)
    for name in requests:
        it.request(name)
    return it


def drive(it: TrackEvaluator, *poses: tuple[float, float, float, float]) -> None:
    """Show poses, each a time in seconds from the begin, x, y and a heading in degrees."""
    for time, x, y, heading in poses:
        it.look(VehiclePose(x, y, math.radians(heading)), BEGIN + round(time * SECOND))


def decided(it: TrackEvaluator) -> Verdict:
    assert it.verdict is not None
    return it.verdict


def values(it: TrackEvaluator) -> dict[str, float | None]:
    return {check.name: check.value for check in decided(it).checks}


def oks(it: TrackEvaluator) -> dict[str, bool]:
    return {check.name: check.ok for check in decided(it).checks}


def test_the_goal_reached_is_a_pass() -> None:
    it = judge()
    drive(it, (0, 0, 0, 0), (1, 1, 0, 0), (3.406, 2.81, 0.05, 0))
    assert it.verdict is None
    drive(it, (3.414, 2.83, 0.05, 0))
    assert (decided(it).outcome, decided(it).reason) == ("passed", "reached finish after 3.41 s")
    assert values(it) == {
        "time-to-goal": pytest.approx(3.414),
        "to-goal": 0.0,
        "wall-margin": pytest.approx(0.07),
        "distance": pytest.approx(1 + math.hypot(1.81, 0.05) + 0.02),
        "max-speed": pytest.approx(2.5),
    }
    assert all(oks(it).values())


def test_without_a_pose_there_is_no_verdict() -> None:
    it = judge()
    with pytest.raises(UnjudgeableError, match=r"^no opendlv.sim.Frame of the vehicle came within 40.00 s$"):
        it.update(BEGIN + 41 * SECOND)
    with pytest.raises(UnjudgeableError, match=r"before the input ended after 2.00 s$"):
        it.end_of_input(BEGIN + 2 * SECOND)
    assert it.verdict is None


@pytest.mark.parametrize(
    ("pose", "what"),
    [((0, 0.0, 0.15, 0), "wall left"), ((0, 3.0, 0.0, 0), "goal finish")],
)
def test_a_start_on_an_obstacle_is_the_fault_of_the_test(pose: tuple[float, float, float, float], what: str) -> None:
    with pytest.raises(UnjudgeableError, match=f"the vehicle stands on {what} from the start, at x = "):
        drive(judge(), pose)


def test_without_a_goal_staying_clear_is_enough() -> None:
    track = Track(LANE.walls, {}, 2.0)
    for last in (lambda it: it.update(BEGIN + 3 * SECOND), lambda it: it.end_of_input(BEGIN + SECOND)):
        it = judge(track)
        drive(it, (0, 0, 0, 0), (1, 1, 0, 0))
        it.update(BEGIN + SECOND)
        last(it)
        assert decided(it).outcome == "passed"
        assert list(values(it)) == ["wall-margin", "distance", "max-speed"]
    assert decided(it).reason == "stayed clear of left and right until the input ended after 1.00 s"


LAP = replace(LANE, gates=(("east", line(1, -0.2, 1, 0.2)), ("west", line(2, -0.2, 2, 0.2))))


def test_a_goal_before_the_gates_does_not_end_the_test() -> None:
    it = judge(LAP)
    drive(it, (0, 1.5, 0, 0), (1, 3.0, 0, 0), (2, 1.5, 0, 0))
    assert it.verdict is None
    it.update(BEGIN + 41 * SECOND)
    assert decided(it).reason == (
        "crossed 0 of 2 gates within 40.00 s: the vehicle is at x = 1.50 m, y = 0.00 m, 0.32 m from east, the next; "
        "finish does not count before the gates"
    )
    checks = {check.name: check for check in decided(it).checks}
    assert (checks["gates"].value, checks["gates"].limit, checks["gates"].ok) == (0, {"min": 2}, False)
    assert not checks["time-to-goal"].ok


def test_gates_and_goal_in_one_frame_count_in_the_order_of_the_way() -> None:
    it = judge(LAP)
    drive(it, (0, 0, 0, 0), (1, 3, 0, 0))
    assert decided(it).reason == "reached finish after 1.00 s"
    it = judge(LAP)
    drive(it, (0, 3.5, 0, 0), (1, 0, 0, 0))
    assert it.verdict is None
    it.end_of_input(BEGIN + 2 * SECOND)
    assert decided(it).reason.startswith("crossed 1 of 2 gates before the input ended after 2.00 s: ")
    backwards = judge(replace(LAP, gates=LAP.gates[::-1]))
    drive(backwards, (0, 3.5, 0, 0), (1, 0, 0, 0))
    assert backwards.verdict is None, "the goal lay before the gates on this way"
    drive(backwards, (2, 3, 0, 0))
    assert decided(backwards).reason == "reached finish after 2.00 s"


CLOSE = replace(LANE, min_margin=0.05)


@pytest.mark.parametrize(
    ("track", "poses", "failed", "reason"),
    [
        (LANE, [(0, 0, 0, 0), (2, 3.5, 0.15, 0)], "wall-margin", "hit wall left"),
        (LAP, [(0, 0, 0, 0), (1, 0.99, 0, 0), (2, 1.5, 0, 0), (3, 2.5, 0, 0), (4, 3, 0, 0)], "", "reached finish"),
        (LAP, [(0, 3, 0, 0), (1, 0, 0, 0), (2, 2.5, 0, 0), (3, 3, 0, 0)], "", "reached finish after 3.00 s"),
        (replace(LAP, goal={}), [(0, 0, 0, 0), (1, 1.5, 0, 0), (2, 2.1, 0, 0)], "", "crossed the last gate, west"),
        (CLOSE, [(0, 0, 0, 0), (1, 0.5, 0.0699, 0), (2, 1, 0.0751, 0)], "wall-margin",
         "came within 0.045 m of wall left after 2.00 s at x = 1.00 m, y = 0.08 m, expected at least 0.05 m"),
        (CLOSE, [(0, 0, 0, 0), (1, 1, 0.07014, 0)], "wall-margin", "came within 0.0499 m of wall left"),
        (CLOSE, [(0, 0, 0, 0), (1, 0.5, 0.15, 0)], "wall-margin", "hit wall left"),
        (CLOSE, [(0, 2.5, 0, 0), (1, 3, 0.0751, 0)], "wall-margin", "came within 0.045 m of wall left"),
        (replace(LANE, max_speed=0.8), [(0, 0.5, 0, 0), (1, 1.3, 0, 0), (1.5, 1.8, 0.05, 0)], "max-speed",
         "drove 1.005 m/s after 1.50 s at x = 1.80 m, y = 0.05 m, expected at most 0.8 m/s"),
    ],
)  # fmt: skip
def test_the_last_pose_decides(
    track: Track, poses: list[tuple[float, float, float, float]], failed: str, reason: str
) -> None:
    it = judge(track)
    drive(it, *poses[:-1])
    assert it.verdict is None
    drive(it, poses[-1])
    assert decided(it).reason.startswith(reason)
    assert [name for name, ok in oks(it).items() if not ok and "goal" not in name and name != "gates"] == (
        [failed] if failed else []
    )
    assert decided(it).outcome == ("failed" if failed else "passed")


def test_a_goal_that_the_application_did_not_drive_to_is_no_pass() -> None:
    it = judge(requests=[])
    drive(it, (0, 0, 0, 0), (4, 3, 0, 0))
    assert (decided(it).outcome, decided(it).silent, decided(it).reason) == (
        "failed",
        True,
        "the application sent no GroundSteeringRequest and no PedalPositionRequest, "
        "although the vehicle reached finish after 4.00 s",
    )


def hanging(track: Track = LANE) -> TrackEvaluator:
    """A judge whose application sends requests until 1.5 s, and then no more."""
    it = TrackEvaluator(track, VehicleBox(0.36, 0.16), Requests(max_silence=2.0))
    it.begin(BEGIN)
    for number in range(16):
        it.update(BEGIN + number * SECOND // 10)
        it.request(REQUESTS[number % 2])
    drive(it, (1.5, 0, 0, 0))
    return it


def test_an_application_that_hangs_fails_even_if_its_vehicle_rolls_on() -> None:
    it = hanging()
    it.update(BEGIN + 3_500_000)
    assert it.verdict is None
    it.update(BEGIN + 3_510_000)
    assert (decided(it).outcome, decided(it).reason) == (
        "failed",
        "no request came between 1.50 s and 3.51 s (at most 2 s)",
    )
    assert values(it)["silence"] == pytest.approx(2.01) and not oks(it)["silence"]


def test_a_goal_reached_in_silence_is_no_pass() -> None:
    it = hanging()
    drive(it, (3.6, 3, 0, 0))
    assert decided(it).reason == (
        "no request came between 1.50 s and 3.60 s (at most 2 s), although the vehicle reached finish after 3.60 s"
    )
    it = hanging()
    drive(it, (3.4, 3, 0, 0))
    assert decided(it).outcome == "passed" and values(it)["silence"] == pytest.approx(1.9) and oks(it)["silence"]


def test_the_begin_forgets_what_was_before() -> None:
    it = TrackEvaluator(LANE, VehicleBox(0.36, 0.16))
    it.update(BEGIN - 9 * SECOND)
    drive(it, (-9, 2, 0.1, 0), (-5, 0, 0, 0))
    it.begin(BEGIN)
    drive(it, (-0.001, 0, 0, 0), (1, 0.5, 0, 0), (9, 3, 0, 0))
    assert values(it)["distance"] == pytest.approx(3)
    assert values(it)["wall-margin"] == pytest.approx(0.12)
    assert values(it)["max-speed"] == pytest.approx(0.5 / 1.001)


def test_what_is_recorded_is_what_was_judged() -> None:
    """Of each move the distance and the speed by which it was judged, none before the begin and none after the end."""
    it = judge(replace(LANE, max_speed=3.0))
    drive(it, (-1, -0.5, 0, 0), (0, 0, 0, 0), (1, 1, 0.05, 3), (2, 2.5, 0, 0), (2.5, 2.9, 0, 0), (9, 0, 0, 0))
    lines = [json.loads(line) for line in it.judged.lines({})]
    (margins, speeds) = (array("f", base64.b64decode(line["values"])).tolist() for line in lines if "samples" in line)
    assert values(it)["wall-margin"] == pytest.approx(min(margins)) and len(margins) == len(speeds) == 4
    assert values(it)["max-speed"] == pytest.approx(max(speeds))
    assert [(line["low"], line["high"]) for line in lines if "series" in line] == [(0, None), (None, 3)]
