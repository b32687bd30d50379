import logging
import math
from pathlib import Path

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from services.base import Context, Flags, Output
from services.dynamic_model.service import DynamicModel
from tests.services.process import receive, running, send

SECOND = 1_000_000
STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"


FLAGS = {
    "freq": 100.0,
    "steps": 1,
    "vehicle": None,
    "frame-id": 3,
    "latency": 0.0,
    "grip": 1.0,
    "power": 1.0,
    "steering-offset": 0.0,
}


def service(**flags: object) -> DynamicModel:
    return DynamicModel(Context("dynamic-model", Flags({**FLAGS, **flags}), MessageSet.standard()))


def test_requests_move_the_body_that_its_output_tells() -> None:
    model, messages = service(), MessageSet.standard()
    assert model.period == 10_000
    model.inputs[PEDAL, None](messages.type(PEDAL)(position=0.1), 0)
    model.inputs[STEERING, None](messages.type(STEERING)(groundSteering=0.1), 0)
    for now in range(0, 3_000_001, 10_000):
        (output,) = model.update(now)
    assert isinstance(output, Output)
    state = output.message
    assert (state.DESCRIPTOR.full_name, output.sender_stamp) == ("opendlv.sim.KinematicState", 3)
    motion = model.vehicle.motion
    assert [state.vx, state.vy, state.yawRate] == pytest.approx([motion.vx, motion.vy, motion.yaw_rate])
    assert [state.vz, state.rollRate, state.pitchRate] == [0, 0, 0]
    assert state.vx > 0.6 and state.yawRate > 0.1


def test_what_is_no_number_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    model, messages = service(), MessageSet.standard()
    with caplog.at_level(logging.WARNING):
        model.inputs[PEDAL, None](messages.type(PEDAL)(position=math.nan), 0)
        model.inputs[STEERING, None](messages.type(STEERING)(groundSteering=math.inf), 0)
    assert [record.getMessage() for record in caplog.records] == [
        "ignored a PedalPositionRequest of nan, and will ignore all that are not finite"
    ]
    assert model.vehicle.rejected == 2


def test_the_condition_of_the_flags() -> None:
    model = service(**{"grip": 0.5, "power": 0.8, "steering-offset": 3.0, "latency": 0.05})
    car = model.vehicle.car
    assert (car.cornering_front, car.cornering_rear, car.gain_forward, car.gain_reverse) == (7.5, 7.5, 20.8, 4.0)
    model.update(0)
    model.inputs[PEDAL, None](MessageSet.standard().type(PEDAL)(position=0.1), 0)
    for now in range(10_000, 1_000_001, 10_000):
        model.update(now)
    assert model.vehicle.motion.yaw_rate > 0.05


def test_another_car_and_finer_steps(tmp_path: Path) -> None:
    (tmp_path / "car.yml").write_text("mass: 2\n")
    model = service(vehicle=str(tmp_path / "car.yml"), steps=4)
    assert model.vehicle.car.mass == 2
    model.inputs[PEDAL, None](MessageSet.standard().type(PEDAL)(position=0.1), 0)
    model.update(0)
    model.update(10_000)
    assert model.vehicle.motion.vx == pytest.approx(0.65 * (1 - (1 - 0.0025 * 4 / 2) ** 4), rel=1e-6)


def test_the_command_reset_and_no_other() -> None:
    model, messages = service(), MessageSet.standard()
    model.inputs[PEDAL, None](messages.type(PEDAL)(position=0.1), 0)
    for now in (0, SECOND):
        model.update(now)
    command = model.inputs["opendlv.sim.Command", None]
    command(messages.type("opendlv.sim.Command")(command="other"), 0)
    assert model.vehicle.motion.vx > 0.5
    command(messages.type("opendlv.sim.Command")(command="reset"), 0)
    (output,) = model.update(2 * SECOND)
    assert (output.message.vx, output.message.vy, output.message.yawRate) == (0, 0, 0)


def test_on_the_bus(cid: int, tmp_path: Path) -> None:
    with Session(cid) as session, running("dynamic_model", tmp_path, f"--cid={cid}", "--frame-id=7"):
        first, state = receive(session, "opendlv.sim.KinematicState", 7)
        assert state.vx == 0
        send(session, PEDAL, sender_stamp=42, position=-0.5)
        while state.vx == 0:
            envelope, state = receive(session, "opendlv.sim.KinematicState", 7)
        assert state.vx < 0
        assert envelope.sample_time > first.sample_time
        assert (envelope.sample_time - first.sample_time) % 10_000 == 0
