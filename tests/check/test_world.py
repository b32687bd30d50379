"""What the application of a test is told, and which services hear what it is not."""

from pathlib import Path

from dodo_dsl.check.senders import services, told, told_in_words
from tests.check.contexts import resolved

APPLICATION = """\
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=1
    x-dodo:
      in: [opendlv.sim.Frame/0, opendlv.proxy.DistanceReading, opendlv.logic.perception.DetectionBoundingBox]
      out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]
"""
OWN = """\
evaluation: {judge: {uses: judge}}
# dodo.yml
services: [my_services]
# my_services/judge/service.yml
name: judge
layers: [evaluation]
image: judge
process: [./judge]
description: Judges the drive.
messages: {in: [opendlv.sim.Frame/0, opendlv.proxy.GroundSteeringRequest], out: []}
"""


def test_it_is_told_what_it_declares_of_what_only_a_simulation_has(tmp_path: Path) -> None:
    ends = told(resolved(APPLICATION, tmp_path).wiring)
    assert [str(end.port) for end in ends] == ["opendlv.sim.Frame/0"]
    assert told(resolved("", tmp_path / "without").wiring) == ()


def test_in_words() -> None:
    assert told_in_words(()) == ""
    pose = "the application gets its true pose (opendlv.sim.KinematicState/0)"
    assert told_in_words(("opendlv.sim.KinematicState/0",)) == pose
    assert told_in_words(("dodo.EndOfInput",)) == "the application gets dodo.EndOfInput"


def test_services_of_the_deployment_need_not_say_where_they_listen(tmp_path: Path) -> None:
    assert services(resolved("", tmp_path / "shipped"), ("dodo-recorder",)) == (
        "camera", "dodo-recorder", "pose", "track", "vehicle",
    )  # fmt: skip
    assert "judge?=opendlv.sim.Frame/0" in services(resolved(OWN, tmp_path / "own"), ())
