import math

import pytest

from dodo_dsl.opendlv import odvd
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags, Output, UnusableMessageError
from services.integrator.service import OLD_FRAME, Integration

STATE = "opendlv.sim.KinematicState"
START = {"freq": 100.0, "x": 1, "y": 2.0, "z": 0.5, "roll": 0, "pitch": 0, "yaw": 90.0, "frame-id": 4}
START |= {"copy-id": None, "euler": False}


def service(**flags: object) -> Integration:
    return Integration(Context("integrator", Flags({**START, **flags}), MessageSet.standard()))


def test_the_frame_starts_where_the_flags_say_and_follows_the_states() -> None:
    body, kind = service(), MessageSet.standard().type(STATE)
    assert list(body.inputs) == [(STATE, 4), ("opendlv.sim.Command", None)]
    (output,) = body.update(0)
    frame = output.message
    assert (frame.DESCRIPTOR.full_name, output.sender_stamp) == ("opendlv.sim.Frame", 4)
    assert [frame.x, frame.y, frame.z] == [1, 2, 0.5]
    assert [frame.qx, frame.qy, frame.qz, frame.qw] == pytest.approx([0, 0, math.sqrt(0.5), math.sqrt(0.5)])
    body.inputs[STATE, 4](kind(vx=2.0, vy=0.5), 0)
    (output,) = body.update(1_000_000)
    assert [output.message.x, output.message.y, output.message.z] == pytest.approx([0.5, 4.0, 0.5])


def test_a_state_that_is_not_finite_changes_nothing() -> None:
    body, kind = service(), MessageSet.standard().type(STATE)
    list(body.update(0))
    body.inputs[STATE, 4](kind(vx=1.0), 0)
    with pytest.raises(UnusableMessageError, match="not finite"):
        body.inputs[STATE, 4](kind(vx=math.inf, yawRate=math.nan), 500_000)
    (output,) = body.update(1_000_000)
    assert output.message.y == pytest.approx(3)


def test_frames_of_set_09_and_copies() -> None:
    body = service(euler=True, yaw=30.0, pitch=20.0, roll=10.0, **{"copy-id": 9})
    outputs = list(body.update(5))
    assert [type(o) for o in outputs] == [Output, Envelope] * 2
    old = MessageSet(odvd.load(OLD_FRAME))
    for (new, before), stamp in zip((outputs[:2], outputs[2:]), (4, 9), strict=True):
        assert isinstance(new, Output) and isinstance(before, Envelope)
        assert (new.sender_stamp, before.sender_stamp, before.data_type, before.sample_time) == (stamp, stamp, 1001, 5)
        frame = old.decode(1001, before.payload)
        assert [frame.x, frame.y, frame.z] == [1, 2, 0.5]
        assert [math.degrees(a) for a in (frame.roll, frame.pitch, frame.yaw)] == pytest.approx([10, 20, 30])


def test_the_command_reset_and_no_other() -> None:
    body, messages = service(), MessageSet.standard()
    list(body.update(0))
    body.inputs[STATE, 4](messages.type(STATE)(vx=1.0), 0)
    for command, y in (("other", 3), ("reset", 2)):
        body.inputs["opendlv.sim.Command", None](messages.type("opendlv.sim.Command")(command=command), 0)
        (output,) = body.update(1_000_000)
        assert isinstance(output, Output)
        assert output.message.y == pytest.approx(y)
