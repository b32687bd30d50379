"""A service that is killed and started anew in the middle of a drive: those that hear it or see its pictures go on."""

import json
import os
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.session import Session
from tests.services.process import PATIENCE, ROOT, receive, running

FRAME, IMAGE = 1003, 1055
SEEN = "opendlv.proxy.ImageReadingShm"
WAY = ["--start=at-once", "--freq=50", "--frame-id=3"]
CAMERAS = {
    "camera": ["--source=file", "--file=tests_registry/maps/static-rig/floor.png", "--width=320", "--height=240"],
    "virtual_camera": ["--map-path=tests_registry/maps/straight", "--width=320", "--height=240", "--start-x=0"],
    "rec_replay": ["--rec=tests_registry/recordings/static-rig.rec", "--await-begin=false", "--sample-times=test"],
}


@contextmanager
def perception(cid: int, name: str, width: int, height: int) -> Iterator[subprocess.Popen[str]]:
    """The example application's perception, which attaches to a memory and says of each picture that it saw it."""
    flags = [f"--cid={cid}", f"--name={name}", f"--width={width}", f"--height={height}"]
    process = subprocess.Popen(
        [sys.executable, str(ROOT / "examples/kiwi/perception.py"), *flags],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def times(path: Path, data_type: int) -> list[int]:
    """Sample times of the messages of a kind that are in a recording already."""
    if not path.stat().st_size:
        return []
    with Recording(path) as recording:
        return [int(sampled) for sampled in recording.index["sampled"][recording.index["data_type"] == data_type]]


def until(is_so: Callable[[], bool]) -> None:
    """Wait until it is so."""
    end = time.monotonic() + PATIENCE
    while not is_so():
        assert time.monotonic() < end, "it did not come to be"
        time.sleep(0.02)


@pytest.mark.realtime
@pytest.mark.parametrize(
    "module",
    [
        pytest.param("camera", marks=pytest.mark.proof),
        "virtual_camera",
        pytest.param("rec_replay", marks=pytest.mark.proof),
    ],
)
def test_readers_and_the_recorder_survive_a_restart_of_a_camera(module: str, cid: int, tmp_path: Path) -> None:
    name, rec = f"dodo-test-{uuid.uuid4().hex[:8]}", tmp_path / "test.rec"
    width, height = (640, 480) if module == "rec_replay" else (320, 240)
    flags = [f"--cid={cid}", f"--name.argb={name}.argb", f"--name.i420={name}.i420", *CAMERAS[module]]
    record = [f"--rec={rec}", "--frames=50", f"--memories={name}.i420:{width}x{height}"]
    with (
        Session(cid) as session,
        running("rec_recorder", tmp_path, f"--cid={cid}", *record) as recorder,
        perception(cid, f"{name}.argb", width, height) as application,
    ):
        last = 0
        for _ in range(2):
            with running(module, tmp_path, *flags) as camera:
                seen = [receive(session, SEEN)[0].sample_time for _ in range(4)]
                until(lambda last=last: max(times(rec, IMAGE), default=0) > last)  # type: ignore[misc]
                camera.kill()
                camera.wait(PATIENCE)
            assert seen == sorted(set(seen)) and seen[0] > last
            while (envelope := session.receive(0.2)) is not None:
                last = max(last, envelope.sample_time)
        assert recorder.poll() is None and application.poll() is None


@pytest.mark.realtime
def test_a_second_recorder_goes_on_where_a_killed_one_ended(cid: int, tmp_path: Path) -> None:
    parts = []
    with running("beacon", tmp_path, f"--cid={cid}", *WAY, "--points=0 0,90 0", "--speed=1") as beacon:
        for rec in (tmp_path / "one.rec", tmp_path / "two.rec"):
            with running("rec_recorder", tmp_path, f"--cid={cid}", f"--rec={rec}") as recorder:
                until(lambda rec=rec: len(times(rec, FRAME)) > 3)  # type: ignore[misc]
                recorder.kill()
                recorder.wait(PATIENCE)
            parts.append(times(rec, FRAME))
        assert beacon.poll() is None
    assert all((np.diff(part) == 20_000).all() for part in parts) and parts[0][-1] < parts[1][0]


@pytest.mark.realtime
def test_an_evaluator_survives_a_restart_of_what_moves_the_vehicle(cid: int, tmp_path: Path) -> None:
    track = ["--map-path=tests_registry/maps/straight", "--gates=finish", "--walls=left,right", "--frame-id=3"]
    track += ["--max-silence=600"]
    with Session(cid) as session, running("collision", tmp_path, f"--cid={cid}", *track) as judge:
        session.send(session.messages.type("dodo.TestBegin")())
        session.send(session.messages.type("opendlv.proxy.GroundSteeringRequest")())
        with running("beacon", tmp_path, f"--cid={cid}", *WAY, "--points=0 0,0 1", "--speed=0.5") as first:
            while receive(session, "opendlv.sim.Frame", 3)[1].y < 0.1:
                pass
            first.kill()
            first.wait(PATIENCE)
        assert judge.poll() is None
        with running("beacon", tmp_path, f"--cid={cid}", *WAY, "--points=0 0.2,0 3.5", "--speed=6"):
            out, err = judge.communicate(timeout=PATIENCE)
    verdict = json.loads(out.splitlines()[-1])
    assert (judge.returncode, verdict["outcome"], err) == (0, "passed", "")
    assert {check["name"]: check["value"] for check in verdict["checks"]}["gates"] == 1
