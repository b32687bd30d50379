"""Ports of services and of the application, and who produces what."""

from pathlib import Path

import pytest

from dodo_dsl.application.model import Declared
from dodo_dsl.check.wiring import ANYTHING, Port, message, wire
from dodo_dsl.diagnostics import Span
from tests.check.contexts import resolved

HERE = Span("x.yml")


@pytest.mark.parametrize(
    ("consumer", "producer", "expected"),
    [
        (("a.B", None), ("a.B", 3), True),
        (("a.B", 3), ("a.B", 3), True),
        (("a.B", 3), ("a.B", None), True),
        (("a.B", 3), ("a.B", 4), False),
        (("a.B", None), ("a.C", None), False),
        (("a.B", 3), (ANYTHING, None), True),
    ],
)
def test_what_a_port_consumes(
    consumer: tuple[str, int | None], producer: tuple[str, int | None], expected: bool
) -> None:
    assert Port("message", *consumer).consumes(Port("message", *producer)) is expected


def test_a_test_without_application(tmp_path: Path) -> None:
    wiring = wire(resolved("", tmp_path).services, None)
    assert not wiring.has_application
    assert {str(end.port) for end in wiring.produced if end.service == "camera"} == {"video0.argb", "video0.i420"}
    assert [str(end.port) for end in wiring.produced if end.service == "pose"] == ["opendlv.sim.Frame/0"]
    assert {str(end.port) for end in wiring.required() if end.port.can_be_required} == {
        "opendlv.proxy.GroundSteeringRequest",
        "opendlv.proxy.PedalPositionRequest",
    }
    assert wiring.application_may_produce(message("opendlv.proxy.Anything", None))


TWO_CARS = """\
action:
  vehicle: {uses: dynamic-model}
  pose: {uses: integrator}
  rival: {uses: beacon, with: {frame-id: 7, hold: true}}
# tests/maps/plain/map.json
{"model": [{"name": "car", "file": "car.obj", "color": [1, 0, 0], "frames": [7, 0]}, {"frames": "x"}, {"frames": [9]}],
 "obstacles": [{"name": "finish", "lines": [[-1, 3, 1, 3]]}]}
"""


def test_frames_at_which_a_map_has_models_are_consumed(tmp_path: Path) -> None:
    """But for the own one, and whoever sends them, as a map may have more cars than a test."""
    services = resolved(TWO_CARS.replace(', {"frames": "x"}', ""), tmp_path).services
    consumed = [(str(end.port), end.port.optional) for end in wire(services, None).consumed if end.service == "camera"]
    assert consumed == [("opendlv.sim.Frame/0", False), ("opendlv.sim.Frame/7", True), ("opendlv.sim.Frame/9", True)]
    wiring = wire(services, None)
    assert [end.service for end in wiring.producers(message("opendlv.sim.Frame/7", None))] == ["rival"]
    assert [end.service for end in wiring.producers(message("opendlv.sim.Frame/0", None))] == ["pose"]


def test_a_wrong_map_has_no_models_at_frames(tmp_path: Path) -> None:
    services = resolved(TWO_CARS, tmp_path).services
    consumed = [str(end.port) for end in wire(services, None).consumed if end.service == "camera"]
    assert consumed == ["opendlv.sim.Frame/0"]


def test_a_test_with_declarations(tmp_path: Path) -> None:
    own = Declared((("a.In", HERE),), (("a.Out/2", HERE),), (("a.Out", HERE),), ("a.Done", HERE), 0, HERE)
    wiring = wire(resolved("", tmp_path).services, {"driver": own})
    assert [(end.layer, str(end.port)) for end in wiring.application_produces] == [("application", "a.Out/2")]
    assert [str(end.port) for end in wiring.application_consumes] == ["a.In"]
    assert ([str(end.port) for end in wiring.answers], wiring.done) == (["a.Out"], "a.Done")
    assert wiring.application_may_produce(message("a.Out", None))
    assert not wiring.application_may_produce(message("a.Other", None))
    open_ended = wire((), {"driver": own, "eyes": None})
    assert open_ended.undeclared == ("eyes",)
    assert open_ended.application_may_produce(message("a.Other", None))


def test_an_application_hears_the_inertial_sensor(tmp_path: Path) -> None:
    kinds = (
        "proxy.AngularVelocityReading",
        "proxy.AccelerationReading",
        "proxy.MagneticFieldReading",
        "logic.sensation.Geolocation",
    )
    example = f"""\
environment: {{imu: {{uses: inertial-sensor, with: {{sender: 3, magnetic-field: false}}}}}}
# docker-compose.yml
services:
  driver: {{image: driver, command: --cid=1, x-dodo: {{in: [{", ".join(f"opendlv.{kind}/3" for kind in kinds)}]}}}}
"""
    wiring = resolved(example, tmp_path).wiring
    heard = [str(end.port) for end in wiring.application_consumes if wiring.producers(end.port)]
    assert heard == [f"opendlv.{kind}/3" for kind in kinds if "Magnetic" not in kind]
