"""Whole tests in lockstep of a robot with a lidar that is driven by a Twist."""

import math
import shutil
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv import MessageSet, Recording
from tests.drive.applications import ROOT, dodo, program, results

pytestmark = pytest.mark.slow

MAP = ROOT / "examples/ranges/tests/sil-closed-corridor/corridor"
Y, YAW = 0.05, math.radians(4)
SPEC = """\
dodo: 1
name: sil-robot
description: Drive along a corridor by a lidar.
level: sil
kind: closed-loop
timeout: 60 s
clock: lockstep
environment:
  lidar: {uses: lidar, with: {map-path: corridor, rays: 1080, freq: 20 Hz, walls: ["*"], noise: 5 mm}}
  exact: {uses: odometry}
  drifting: {uses: odometry, with: {id: 1, yaw-bias: 0.5 deg/s, speed-noise: 2 cm/s}}
action:
  vehicle: {uses: dynamic-model, with: {drive: differential, max-acceleration: 1 m/s2, slip: 5 %, latency: 40 ms}}
  pose: {uses: integrator, with: {y: 5 cm, yaw: 4 deg}}
evaluation:
  track: {uses: collision, with: {map-path: corridor, length: 20 cm, width: 16 cm, goal: finish, walls: ["*"]}}
"""
SCAN, ODOMETRY, FRAME = "robot.PlanarScan", "robot.OdometryReading", "opendlv.sim.Frame"
Sent = dict[tuple[str, int], dict[int, Any]]


def drive(folder: Path) -> tuple[dict[str, Any], Sent]:
    """What became of the test, and what was sent on its bus: by name and sender the messages by their sample times."""
    spec = folder / "tests/sil-robot/sil-robot.dodo.yml"
    shutil.copytree(MAP, spec.parent / "corridor")
    spec.write_text(SPEC)
    shutil.copy(Path(__file__).parent / "corridor.py", folder)
    declared = {"in": [SCAN], "out": ["opendlv.proxy.GroundMotionRequest"]}
    compose = program(folder, "python", "corridor.py", **{"x-dodo": declared})
    dodo("run", str(spec), "--application", str(compose), "--report", str(folder / "report"), code=0)
    messages, sent = MessageSet.standard(), Sent()
    with Recording(folder / "report/sil-robot/test.rec") as recording:
        for e in recording.envelopes():
            of_sender = sent.setdefault((messages.name(e.data_type), e.sender_stamp), {})
            of_sender[e.sample_time] = messages.decode(e.data_type, e.payload)
    return results(folder / "report")["sil-robot"], sent


def test_a_robot_drives_the_same_each_time(tmp_path: Path) -> None:
    """Scans and odometry, too; and odometry without errors is the true way from the start."""
    (first, sent), (second, again) = (drive(tmp_path / str(number)) for number in range(2))
    assert (first["outcome"], first["clock"], first["checks"]) == ("passed", "lockstep", second["checks"])
    for key in ((SCAN, 0), (ODOMETRY, 0), (ODOMETRY, 1), (FRAME, 0)):
        assert len(sent[key]) > 50 and sent[key] == again[key]
    assert {len(scan.ranges) for scan in sent[SCAN, 0].values()} == {4 * 1080}
    frames, exact, drifting = sent[FRAME, 0], sent[ODOMETRY, 0], sent[ODOMETRY, 1]
    c, s = math.cos(YAW), math.sin(YAW)
    places = {time: (c * read.x - s * read.y, s * read.x + c * read.y + Y) for time, read in exact.items()}
    both = places.keys() & frames.keys()  # the last reading may be of the end
    assert max(math.dist((frames[t].x, frames[t].y), places[t]) for t in both) < 1e-6 and len(both) > len(places) - 2
    drift = [drifting[time].yaw - exact[time].yaw for time in drifting]
    assert drift[-1] == pytest.approx(math.radians(0.5) * first["sim_s"], rel=0.1)
