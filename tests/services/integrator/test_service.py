import logging
import math
from pathlib import Path

import pytest

from dodo_dsl.opendlv.messages import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import Context, Flags
from services.integrator.service import Integration
from tests.services.process import hear, running, say

STATE = "opendlv.sim.KinematicState"
START = {"freq": 100.0, "x": 1, "y": 2.0, "z": 0.5, "roll": 0, "pitch": 0, "yaw": 90.0, "frame-id": 4}


def service() -> Integration:
    return Integration(Context("integrator", Flags(START), MessageSet.standard()))


def test_the_frame_starts_where_the_flags_say_and_follows_the_states() -> None:
    body, kind = service(), MessageSet.standard().type(STATE)
    assert list(body.inputs) == [(STATE, 4)]
    (output,) = body.update(0)
    frame = output.message
    assert (frame.DESCRIPTOR.full_name, output.sender_stamp) == ("opendlv.sim.Frame", 4)
    assert [frame.x, frame.y, frame.z] == [1, 2, 0.5]
    assert [frame.qx, frame.qy, frame.qz, frame.qw] == pytest.approx([0, 0, math.sqrt(0.5), math.sqrt(0.5)])
    body.inputs[STATE, 4](kind(vx=2.0, vy=0.5), 0)
    (output,) = body.update(1_000_000)
    assert [output.message.x, output.message.y, output.message.z] == pytest.approx([0.5, 4.0, 0.5])


def test_a_state_that_is_not_finite_is_said_once_and_changes_nothing(caplog: pytest.LogCaptureFixture) -> None:
    body, kind = service(), MessageSet.standard().type(STATE)
    body.update(0)
    body.inputs[STATE, 4](kind(vx=1.0), 0)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            body.inputs[STATE, 4](kind(vx=math.inf, yawRate=math.nan), 500_000)
    assert len(caplog.records) == 1 and "is ignored" in caplog.text
    (output,) = body.update(1_000_000)
    assert output.message.y == pytest.approx(3)


def test_on_the_bus(cid: int, tmp_path: Path) -> None:
    flags = (f"--cid={cid}", "--frame-id=4", "--x=1", "--yaw=180")
    with Session(cid) as session, running("integrator", tmp_path, *flags):
        _, frame = hear(session, "opendlv.sim.Frame", 4)
        assert [frame.x, frame.y] == [1, 0]
        say(session, STATE, sender_stamp=5, vy=100.0)
        say(session, STATE, sender_stamp=4, vx=100.0)
        while frame.x == 1:
            _, frame = hear(session, "opendlv.sim.Frame", 4)
        assert frame.x < 1 and frame.y == pytest.approx(0, abs=1e-3)
