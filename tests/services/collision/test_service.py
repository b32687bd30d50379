import json
import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, UnjudgeableError, UnusableMessageError
from services.base.flags import load_manifest, parse
from services.collision.service import Collision
from tests.services.process import ROOT

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


MANIFEST = load_manifest(ROOT / "services" / "collision")


def service(lane: Path, wall: Callable[[], float] = time.monotonic, on_rig: bool = False, **changes: Any) -> Collision:
    words = {
        "goal": "finish",
        "walls": "left,right",
        "max-silence": 60,
        "max-time": 40,
        "map-path": lane,
        "frame-id": 2,
        **changes,
    }
    flags = [f"--{name}={value}" for name, value in {"cid": 128, **words}.items() if value is not None]
    return Collision(Context("collision", parse(MANIFEST, flags), MessageSet.standard(), on_rig=on_rig), wall)


def frame(x: float, y: float, heading: float = 0.0) -> Any:
    return MessageSet.standard().type(FRAME)(x=x, y=y, qz=math.sin(heading / 2), qw=math.cos(heading / 2))


def test_requests_are_heard_and_time_runs_out_in_updates(lane: Path) -> None:
    judge = service(lane)
    judge.begin(START)
    judge.inputs[FRAME, 2](frame(0, 0), START)
    judge.inputs["opendlv.proxy.GroundSteeringRequest", None](None, 0)
    judge.update(START + 41_000_000)
    assert judge.verdict is not None
    assert judge.verdict.reason.endswith("; the application sent no PedalPositionRequest")


def test_a_frame_without_an_attitude_is_no_sample(lane: Path) -> None:
    judge = service(lane)
    judge.begin(START)
    for bad in (MessageSet.standard().type(FRAME)(x=1), frame(math.nan, 0)):
        with pytest.raises(UnusableMessageError, match="no position or no attitude"):
            judge.inputs[FRAME, 2](bad, START)
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


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"goal": "left"}, "--goal: left is one of the --walls too"),
        ({"gates": "finish,left"}, "--gates: left is one of the --walls too"),
        ({"gates": "finnish"}, "--gates: the map {lane} has no obstacle 'finnish'; did you mean 'finish'?"),
        ({"walls": None, "min-margin": 0.1}, "--min-margin needs --walls"),
        ({"requests": ""}, "--requests is empty: a drive is the application's only if it sends something"),
        ({"requests": "opendlv.proxy.PedalPositionRequest/x"}, "Request/x' has no whole number as its sender stamp"),
        ({"goal": "finnish"}, "has no obstacle 'finnish'; did you mean 'finish'?"),
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


def test_a_block_of_the_map_is_hit(lane: Path) -> None:
    box = {"name": "crate", "dimension": [0.1, 0.1, 0.3], "color": [1, 0, 0], "instances": [[1.0, 0.1, 0.0, 0.0]]}
    (lane / "map.json").write_text(json.dumps({**LANE, "block": [box]}))
    judge = service(lane, walls="*,blocks")
    judge.begin(START)
    for step in range(10):
        judge.inputs[FRAME, 2](frame(step / 10, 0), START + step * 100_000)
    assert judge.verdict is not None
    assert judge.verdict.reason == "hit wall crate after 0.80 s at x = 0.80 m, y = 0.00 m"
    assert judge.verdict.evidence["obstacle"] == "crate"


@pytest.mark.parametrize(
    ("changes", "least"), [({"goal": None}, 0.36), ({"goal": None, "min-distance": 0.0}, 0.0), ({}, 0.0)]
)
def test_walls_alone_ask_for_a_vehicle_that_drives(lane: Path, changes: dict[str, Any], least: float) -> None:
    assert service(lane, **changes).track.min_distance == least
