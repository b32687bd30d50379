import hashlib
import json
import math
import os
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.message_set import MessageSet
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene
from services.virtual_camera.model import to_i420
from tests.services.built import refusal

FOLDER = package_data.services() / "virtual_camera"
STRAIGHT = package_data.registry() / "maps" / "straight"


@pytest.fixture
def start(tmp_path):
    """Starts the service with flags; whatever still runs at the end is killed."""
    processes = []

    def run(*flags):
        process = subprocess.Popen(
            [sys.executable, "-m", "services.virtual_camera", *flags],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=FOLDER.parents[1],
            text=True,
        )
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_libcluon_gets_the_pictures_of_the_frames_it_sends(start, cid):
    pytest.importorskip("pycluon")
    names = [f"dodo-test-{os.getpid()}-{cid}.{kind}" for kind in ("argb", "i420", "bgr")]
    camera = start(
        f"--cid={cid}", f"--map-path={STRAIGHT}", "--width=320", "--height=240", "--freq=20", "--z=0.095",
        "--x=0.1", "--frame-id=7", f"--name.argb={names[0]}", f"--name.i420={names[1]}",
        f"--name.bgr={names[2]}",
    )  # fmt: skip
    assert select.select([camera.stdout], [], [], 20)[0]
    assert json.loads(camera.stdout.readline()) == {"dodo": "ready"}
    messages = MessageSet.standard()
    frame = messages.type("opendlv.sim.Frame")(x=0.0, y=1.5, z=0.0, qx=0.0, qy=0.0, qz=0.6, qw=0.8)
    begun = time.time()
    viewer = [sys.executable, str(Path(__file__).with_name("libcluon_viewer.py"))]
    output = subprocess.run(
        [*viewer, str(cid), "7", messages.encode(frame).hex(), *names], stdout=subprocess.PIPE, timeout=20, check=True
    ).stdout
    seen = json.loads(output)
    yaw = 2 * math.atan2(frame.qz, frame.qw)
    renderer = Renderer(load_scene(STRAIGHT), 320, 240, math.radians(48.8))
    expected = renderer.render(CameraPose.at(0.1 * math.cos(yaw), 1.5 + 0.1 * math.sin(yaw), 0.095, yaw=yaw))
    bgr = np.ascontiguousarray(expected[..., :3])
    for memory, picture in zip(seen, (expected, to_i420(expected), bgr), strict=True):
        assert (memory["size"], memory["sha256"]) == (picture.nbytes, hashlib.sha256(picture).hexdigest())
        assert begun - 1 < memory["time"] / 1e6 < time.time() + 1
    camera.send_signal(signal.SIGTERM)
    assert camera.wait(10) == 0
    assert not any(Path("/tmp", name).exists() for name in names)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--map-path=/nowhere"], r"/nowhere: cannot be read: No such file"),
        ([], r"are required: --map-path"),
    ],
)
def test_flags_that_cannot_be_met(cid, flags, message):
    names = [f"--name.{kind}=dodo-test-{os.getpid()}-{cid}.{kind}" for kind in ("argb", "i420")]
    assert re.search(message, refusal("virtual_camera", *names, *flags))
