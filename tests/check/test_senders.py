"""Who alone may send what, by the wiring of a test."""

from pathlib import Path

from dodo_dsl.check.senders import senders, truth_delay_s, withheld_truth
from tests.check.contexts import resolved

APPLICATION = """\
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=1
    x-dodo:
      out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest, opendlv.sim.Command]
"""
TRUTH = """\
kind: perception
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain, truth-sender: 9}}
  way: {uses: beacon, with: {length: 3 m}}
action: null
evaluation:
  track: {uses: object-detection, with: {truth-sender: 9, min-recall: 80 %, max-delay: 1500 ms}}
"""


def test_what_services_consume_of_one_another(tmp_path: Path) -> None:
    assert senders(resolved("", tmp_path)) == (
        "dodo.EndOfInput=camera,pose,vehicle",
        "opendlv.sim.Command=",
        "opendlv.sim.Frame/0=pose",
        "opendlv.sim.KinematicState/0=vehicle",
    )


def test_what_the_application_declares_is_its_own(tmp_path: Path) -> None:
    assert "opendlv.sim.Command=" not in senders(resolved(APPLICATION, tmp_path))


def test_truth_is_of_its_producer_and_withheld(tmp_path: Path) -> None:
    test = resolved(TRUTH, tmp_path)
    boxes = [f"opendlv.logic.perception.Detection{kind}/9" for kind in ("BoundingBox", "Property", "Type")]
    assert {f"{box}=camera" for box in boxes} <= set(senders(test))
    assert (withheld_truth(test), truth_delay_s(test)) == (tuple(boxes), 1.5)
    assert withheld_truth(resolved("", tmp_path)) == ()
