import math
from pathlib import Path

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.spec.manifest import load_manifest as load
from services.base import Context, Output
from services.base.flags import load_manifest, parse
from services.dynamic_model.service import DynamicModel

SECOND = 1_000_000
STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"


MANIFEST_FILE = Path(__file__).parents[3] / "services" / "dynamic_model" / "service.yml"
MANIFEST = load_manifest(MANIFEST_FILE.parent)


def service(**flags: object) -> DynamicModel:
    words = [f"--{name}={value}" for name, value in {"cid": 128, "frame-id": 3, **flags}.items()]
    return DynamicModel(Context("dynamic-model", parse(MANIFEST, words), MessageSet.standard()))


def test_another_car(tmp_path: Path) -> None:
    (tmp_path / "car.yml").write_text("mass: 2\n")
    model = service(vehicle=str(tmp_path / "car.yml"))
    model.inputs[PEDAL, None](MessageSet.standard().type(PEDAL)(position=0.1), 0)
    model.update(0)
    model.update(10_000)
    assert model.vehicle.motion.vx == pytest.approx(-0.65 * math.expm1(-0.01 * 4 / 2), rel=1e-4)


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


STEER, SPEED, ACCELERATE, PEDALS, AXLES = (
    f"opendlv.proxy.{name}Request"
    for name in ("GroundSteering", "GroundSpeed", "GroundAcceleration", "PedalPosition", "AxleAngularVelocity")
)


@pytest.mark.parametrize(
    ("flags", "taken"),
    [
        ({}, {(STEER, None), (PEDALS, None)}),
        ({"drive": "kiwi"}, {(STEER, None), (PEDALS, None)}),
        ({"drive": "differential"}, {(PEDALS, 0), (PEDALS, 1)}),
        ({"drive": "differential", "wheel-input": "axle"}, {(AXLES, 0), (AXLES, 1)}),
        ({"drive": "bicycle"}, {(STEER, None), (SPEED, None)}),
        ({"drive": "bicycle", "speed-input": "acceleration"}, {(STEER, None), (ACCELERATE, None)}),
    ],
)
def test_each_drive_takes_the_requests_that_its_manifest_names(
    flags: dict[str, object], taken: set[tuple[str, int | None]]
) -> None:
    both = {("opendlv.proxy.GroundMotionRequest", None), ("opendlv.sim.Command", None)}
    assert set(service(**flags).inputs) == taken | both
    manifest, _ = load(MANIFEST_FILE)
    assert manifest is not None
    named = manifest.messages_with({"wheel-input": "pedal", "speed-input": "speed", **flags}).inputs
    ports = [text.partition("/") for text in named if not text.endswith("?")]
    assert {(name, int(stamp) if stamp else None) for name, _, stamp in ports} == taken


def senders(outputs: list[Output]) -> list[tuple[str, int]]:
    """The messages by their short names, with their sender stamps."""
    return [(output.message.DESCRIPTOR.full_name.rpartition(".")[2], output.sender_stamp) for output in outputs]


def test_a_differential_drive_with_its_odometry() -> None:
    model, messages = service(drive="differential", odometry="true", **{"yaw-rate-id": 7}), MessageSet.standard()
    for stamp, position in ((0, 0.4), (1, 0.6)):
        model.inputs[PEDALS, stamp](messages.type(PEDALS)(position=position), 0)
    for now in range(0, 2_000_001, 10_000):
        outputs = model.update(now)
    wheels = [("AxleAngularVelocityReading", 0), ("AxleAngularVelocityReading", 1)]
    assert senders(outputs) == [("KinematicState", 3), *wheels, ("AngularVelocityReading", 7)]
    state, left, right, yaw_rate = (output.message for output in outputs)
    speeds = [28 * (position - 0.05) / 0.95 for position in (0.4, 0.6)]
    assert [left.axleAngularVelocity, right.axleAngularVelocity] == pytest.approx(speeds)
    assert state.vx == pytest.approx(0.0325 * sum(speeds) / 2)
    assert state.yawRate == yaw_rate.angularVelocityZ == pytest.approx(0.0325 * (speeds[1] - speeds[0]) / 0.14)


@pytest.mark.parametrize("drive", ["kiwi", "bicycle"])
def test_the_odometry_of_a_car_that_steers(drive: str) -> None:
    outputs = service(drive=drive, odometry="true", **{"steering-offset": 2}).update(0)
    steered = [("GroundSpeedReading", 0), ("GroundSteeringReading", 0), ("AngularVelocityReading", 2)]
    assert senders(outputs[1:]) == steered
    assert outputs[2].message.groundSteering == pytest.approx(math.radians(2))


def test_a_bicycle_by_speed_and_one_by_acceleration() -> None:
    messages = MessageSet.standard()
    for flags, name, field, speed in (
        ({}, SPEED, "groundSpeed", 5.0),
        ({"speed-input": "acceleration"}, ACCELERATE, "groundAcceleration", 2.0 * 6),
    ):
        model = service(drive="bicycle", **flags)
        model.inputs[name, None](messages.type(name)(**{field: 5.0 if name == SPEED else 2.0}), 0)
        for now in range(0, 6_000_001, 10_000):
            (output,) = model.update(now)
        assert output.message.vx == pytest.approx(speed, rel=1e-3)
