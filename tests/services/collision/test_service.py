import json
import math
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import Check, Context, Flags, UnjudgeableError
from services.collision.model import REQUESTS
from services.collision.service import Collision
from tests.services.built import built, hand, refusal
from tests.services.process import PATIENCE, running, send

FRAME = "opendlv.sim.Frame"
LANE = {
    "obstacles": [
        {"name": "left", "lines": [[-1, 0.2, 5, 0.2]]},
        {"name": "right", "lines": [[-1, -0.2, 5, -0.2]]},
        {"name": "finish", "lines": [3, -0.2, 3, 0.2]},
    ]
}
START = 1_700_000_000_000_000


@pytest.fixture
def lane(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "map.json").write_text(json.dumps(LANE))
    yield tmp_path


def service(lane: Path, wall: Callable[[], float] = time.monotonic, on_rig: bool = False, **changes: Any) -> Collision:
    flags = {
        "length": 0.36,
        "width": 0.16,
        "height": 0.15,
        "goal": "finish",
        "walls": ["left", "right"],
        "max-time": 40.0,
    }
    none: dict[str, Any] = {
        "gates": [],
        "min-margin": 0.0,
        "requests": list(REQUESTS),
        "max-silence": 60.0,
        "max-speed": None,
        "bodies": None,
        "min-body-margin": None,
        "min-distance": None,
        "height": None,
    }
    return Collision(
        Context(
            "collision",
            Flags({**flags, **none, "map-path": str(lane), "frame-id": 2, **changes}),
            MessageSet.standard(),
            on_rig=on_rig,
        ),
        wall,
    )


def frame(x: float, y: float, heading: float = 0.0) -> Any:
    return MessageSet.standard().type(FRAME)(x=x, y=y, qz=math.sin(heading / 2), qw=math.cos(heading / 2))


def test_frames_of_its_vehicle_bring_the_verdict(lane: Path) -> None:
    judge = service(lane)
    assert set(judge.inputs) == {
        (FRAME, 2),
        ("opendlv.proxy.GroundSteeringRequest", None),
        ("opendlv.proxy.PedalPositionRequest", None),
    }
    judge.begin(START)
    look = judge.inputs[FRAME, 2]
    look(frame(0, 0), START)
    assert judge.verdict is None
    look(frame(0.5, 0.05, math.pi / 2), START + 500_000)
    assert judge.verdict is not None
    assert judge.verdict.reason == "hit wall left after 0.50 s at x = 0.50 m, y = 0.05 m"


def test_requests_are_heard_and_time_runs_out_in_updates(lane: Path) -> None:
    judge = service(lane)
    judge.begin(START)
    judge.inputs[FRAME, 2](frame(0, 0), START)
    judge.inputs["opendlv.proxy.GroundSteeringRequest", None](None, 0)
    judge.update(START + 41_000_000)
    assert judge.verdict is not None
    assert judge.verdict.reason.endswith("; the application sent no PedalPositionRequest")


def test_a_frame_without_an_attitude_is_no_sample(lane: Path, caplog: pytest.LogCaptureFixture) -> None:
    judge = service(lane)
    judge.begin(START)
    for _ in range(2):
        judge.inputs[FRAME, 2](MessageSet.standard().type(FRAME)(x=1), START)
    judge.inputs[FRAME, 2](frame(math.nan, 0), START)
    assert judge.rejected == 3 and len(caplog.records) == 1
    with pytest.raises(Exception, match=r"no opendlv.sim.Frame of the vehicle came before the input ended"):
        judge.end_of_input(START + 1)


def test_frames_that_stop_are_no_verdict_about_the_application(lane: Path) -> None:
    now = [100.0]
    judge = service(lane, wall=lambda: now[0], on_rig=True)
    judge.begin(START)
    look = judge.inputs[FRAME, 2]
    for count in range(3):
        look(frame(0, 0), START + count)
        now[0] += 0.5
    now[0] += 1.4
    judge.update(START + 10)
    now[0] += 0.2
    with pytest.raises(UnjudgeableError, match="no Frame of the vehicle has come for 2 s, and they came before"):
        judge.update(START + 20)


def test_off_a_rig_a_vehicle_may_stop_telling_where_it_is(lane: Path) -> None:
    now = [100.0]
    judge = service(lane, wall=lambda: now[0])
    judge.begin(START)
    for count in range(3):
        judge.inputs[FRAME, 2](frame(0, 0), START + count)
        now[0] += 0.5
    now[0] += 60.0
    judge.update(START + 10)
    assert judge.verdict is None


def test_slow_frames_and_a_single_one_are_waited_for(lane: Path) -> None:
    now = [100.0]
    judge = service(lane, wall=lambda: now[0], on_rig=True)
    judge.begin(START)
    look = judge.inputs[FRAME, 2]
    look(frame(0, 0), START)
    now[0] += 5
    judge.update(START + 1)
    look(frame(0, 0), START + 2)
    now[0] += 14
    judge.update(START + 3)
    assert judge.verdict is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"goal": None, "walls": []}, "nothing to judge: give --goal, --gates, --walls or --min-distance"),
        ({"goal": "left"}, "--goal=left is one of the --walls too"),
        ({"gates": ["finish", "left"]}, "left of --gates is one of the --walls too"),
        ({"gates": ["finnish"]}, "--gates: the map {lane} has no obstacle 'finnish'; did you mean 'finish'?"),
        ({"walls": [], "min-margin": 0.1}, "--min-margin needs --walls"),
        ({"requests": []}, "--requests is empty: a drive is the application's only if it sends something"),
        ({"requests": ["opendlv.proxy.PedalPositionRequest/x"]}, "Request/x' has no whole number as its sender stamp"),
        ({"goal": "finnish"}, "has no obstacle 'finnish'; did you mean 'finish'?"),
        ({"min-body-margin": 0.1}, "--min-body-margin needs --bodies"),
        ({"bodies": True}, "--bodies: no model of the map has 'frames' of other sender stamps than the vehicle's"),
    ],
)
def test_flags_that_make_no_track_are_refused(lane: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"{re.escape(message.format(lane=lane))}$"):
        service(lane, **changes)


def test_frames_of_bodies_are_judged(lane: Path) -> None:
    (lane / "car.obj").write_text("v 0.1 0.2 0\nv -0.1 0.2 0\nv 0 -0.3 0\nf 1 2 3\n")
    car = {"name": "car", "file": "car.obj", "color": [1, 0, 0], "frames": [2, 5]}
    (lane / "map.json").write_text(json.dumps({"model": [car], **LANE}))
    judge = service(lane, bodies=True)
    assert {stamp for name, stamp in judge.inputs if name == FRAME} == {2, 5}
    assert {stamp for name, stamp in service(lane).inputs if name == FRAME} == {2}
    judge.begin(START)
    for at, x in ((START, 0.0), (START + 1_000_000, 2.0)):
        judge.inputs[FRAME, 5](frame(1.0, 0.1), at)
        judge.inputs[FRAME, 2](frame(x, 0.0), at)
    assert judge.verdict is not None
    assert judge.verdict.reason == "hit body car after 1.00 s at x = 2.00 m, y = 0.00 m"


def finished(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    output, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, output, errors


@pytest.mark.thorough
def test_the_verdict_is_one_line_and_the_end(lane: Path, cid: int) -> None:
    flags = (f"--cid={cid}", f"--map-path={lane}", "--goal=finish", "--walls=left,right")
    with Session(cid) as session, running("collision", lane, *flags) as process:
        start = time.time_ns() // 1000 - 3_000_000  # so that its time is not over
        send(session, "dodo.TestBegin", sample_time=start)
        send(session, "opendlv.proxy.PedalPositionRequest", position=0.1)
        send(session, FRAME, sample_time=start + 10_000, qw=1.0)
        send(session, FRAME, sample_time=start + 2_010_000, x=2.9, y=0.05, qw=1.0)
        code, output, errors = finished(process)
    assert (code, errors) == (0, "")
    verdict = json.loads(output.splitlines()[-1])
    assert (verdict["dodo"], verdict["outcome"], verdict["reason"]) == (
        "verdict",
        "passed",
        "reached finish after 2.01 s",
    )
    checks = {check["name"]: check for check in verdict["checks"]}
    assert checks["time-to-goal"] == {
        "name": "time-to-goal", "value": 2.01, "limit": {"max": 60}, "unit": "s", "ok": True
    }  # fmt: skip
    assert checks["wall-margin"]["value"] == pytest.approx(0.07, abs=1e-6)


def test_gates_and_margin_come_from_the_flags(lane: Path) -> None:
    with built("collision", f"--map-path={lane}", "--gates=finish", "--walls=left,right", "--min-margin=0.05") as judge:
        judge.begin(START)
        hand(judge, REQUESTS[0], START)
        hand(judge, FRAME, START + 10_000, 0, qw=1.0)
        hand(judge, FRAME, START + 2_010_000, 0, x=3.1, qw=1.0)
    assert (judge.verdict.outcome, judge.verdict.reason) == ("passed", "crossed the last gate, finish, after 2.01 s")
    checks = {check.name: check for check in judge.verdict.checks}
    assert checks["gates"] == Check("gates", 1, {"min": 1}, "", True)
    assert checks["wall-margin"].limit == {"min": 0.05}


def test_requests_may_be_others(lane: Path) -> None:
    mine = ("opendlv.proxy.TorqueRequest", 3)
    flags = (f"--map-path={lane}", "--goal=finish", f"--requests={mine[0]}/3", "--max-silence=0.5")
    with built("collision", *flags) as judge:
        assert set(judge.inputs) == {(FRAME, 0), mine}
        judge.begin(START)
        judge.update(START)
        hand(judge, mine[0], START, mine[1])
        hand(judge, FRAME, START, 0, qw=1.0)
        judge.update(START + 510_000)
    assert judge.verdict.reason == "no request came between 0.00 s and 0.51 s (at most 0.5 s)"


def test_the_end_of_the_input_of_a_silent_application(lane: Path) -> None:
    with built("collision", f"--map-path={lane}", "--goal=finish") as judge:
        judge.begin(START)
        hand(judge, FRAME, START, 0, qw=1.0)
        judge.end_of_input(START + 500_000)
    verdict = json.loads(judge.verdict.line())
    assert (verdict["outcome"], verdict["reason"]) == (
        "failed",
        "the application sent no GroundSteeringRequest and no PedalPositionRequest before the input ended after 0.50 s",
    )


def test_no_frame_is_an_error_and_no_verdict(lane: Path) -> None:
    with built("collision", f"--map-path={lane}", "--walls=left", "--min-distance=1", "--max-time=0.05") as judge:
        judge.begin(START)
        with pytest.raises(UnjudgeableError, match=r"no opendlv\.sim\.Frame of the vehicle came within 0\.05 s"):
            judge.update(START + 60_000)


def test_a_wrong_name_is_refused(lane: Path) -> None:
    sentence = f"--goal: the map {lane} has no obstacle 'finnish'; did you mean 'finish'?"
    assert refusal("collision", f"--map-path={lane}", "--goal=finnish") == sentence


def test_a_block_of_the_map_is_hit(lane: Path) -> None:
    box = {"name": "crate", "dimension": [0.1, 0.1, 0.3], "color": [1, 0, 0], "instances": [[1.0, 0.1, 0.0, 0.0]]}
    (lane / "map.json").write_text(json.dumps({**LANE, "block": [box]}))
    judge = service(lane, walls=["*", "blocks"])
    judge.begin(START)
    for step in range(10):
        judge.inputs[FRAME, 2](frame(step / 10, 0), START + step * 100_000)
    assert judge.verdict is not None
    assert judge.verdict.reason == "hit wall crate after 0.80 s at x = 0.80 m, y = 0.00 m"
    assert judge.verdict.evidence["obstacle"] == "crate"


def test_a_wheel_that_is_never_asked_is_named(lane: Path) -> None:
    model = service(lane, requests=[f"{REQUESTS[1]}/0", f"{REQUESTS[1]}/1"], **{"max-time": 1.0})
    model.update(START)
    model.inputs[REQUESTS[1], 0](None, START)
    hand(model, FRAME, START, 2, qw=1.0)
    model.update(START + 2_000_000)
    assert model.verdict is not None and "sent no PedalPositionRequest/1" in model.verdict.reason


@pytest.mark.parametrize(
    ("changes", "least"), [({"goal": None}, 0.36), ({"goal": None, "min-distance": 0.0}, 0.0), ({}, 0.0)]
)
def test_walls_alone_ask_for_a_vehicle_that_drives(lane: Path, changes: dict[str, Any], least: float) -> None:
    assert service(lane, **changes).track.min_distance == least
