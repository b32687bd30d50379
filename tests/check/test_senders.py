"""Who alone may send what, by the wiring of a test."""

from pathlib import Path

import pytest

from dodo_dsl.check.senders import senders, truth
from dodo_dsl.check.wiring_rules import check_producers
from tests.check.contexts import found, resolved
from tests.run.recorded.made import message, write

STEERING = "opendlv.proxy.GroundSteeringRequest"

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


def test_truth_is_of_its_producer(tmp_path: Path) -> None:
    test = resolved(TRUTH, tmp_path)
    boxes = [f"opendlv.logic.perception.Detection{kind}/9" for kind in ("BoundingBox", "Property", "Type")]
    assert {f"{box}=camera" for box in boxes} <= set(senders(test))
    assert truth(test) == tuple(boxes)
    assert truth(resolved("", tmp_path)) == ()


REPLAY = f"""\
level: dil
kind: open-loop
environment:
  camera: null
  drive: {{uses: rec-replay, with: {{rec: drive.rec}}}}
action: null
evaluation:
  track:
    uses: continuous-signal
    with: {{message: {STEERING}, field: groundSteering, target: drive.rec, max-mean: 0.1, TARGET}}
"""


@pytest.mark.parametrize("application", ["", APPLICATION])
@pytest.mark.parametrize(
    ("target", "guarded", "left_out"),
    [
        ("target-sender: 0", "", [f"{STEERING}/0"]),
        ("target-message: opendlv.proxy.GroundSteeringRequest", "", [f"{STEERING}/0"]),
        ("target-sender: 9", f"{STEERING}/9=drive", [f"{STEERING}/0"]),
        ("target-sender: 8", "", [f"{STEERING}/0"]),
    ],
)
def test_a_recorded_target_is_never_the_producer_of_what_the_application_sends(
    tmp_path: Path, application: str, target: str, guarded: str, left_out: list[str]
) -> None:
    """The recording has the signal under the application's sender stamp, 0, and under 9."""
    folder = tmp_path / "tests" / "example"
    folder.mkdir(parents=True)
    made = [
        message(STEERING, 1_700_000_000_000_000 + n)._replace(sender_stamp=stamp) for n in (1, 2) for stamp in (0, 9)
    ]
    write(folder / "drive.rec", *made)
    test = resolved(REPLAY.replace("TARGET", target) + application, tmp_path)
    said = [word for word in senders(test) if word.startswith(STEERING)]
    assert said == [guarded] * bool(guarded)
    assert truth(test) == tuple(word.partition("=")[0] for word in said)
    assert list(test.left_out["drive"]) == left_out


PRINTED = """\
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=1
    x-dodo:
      lines:
        - {match: 'steer (?P<groundSteering>[-.0-9]+)', message: opendlv.proxy.GroundSteeringRequest}
        - {match: 'seen (?P<type>[0-9]+)', message: opendlv.logic.perception.DetectionType, sender: 9}
      out: [opendlv.proxy.PedalPositionRequest]
"""


def test_what_is_printed_is_nothing_by_which_it_is_judged(tmp_path: Path) -> None:
    folder = tmp_path / "tests" / "example"
    folder.mkdir(parents=True)
    write(folder / "drive.rec", *(message(STEERING, 1_700_000_000_000_000)._replace(sender_stamp=s) for s in (0, 9)))
    replay = REPLAY.replace("  camera: null\n", "").replace("action: null\n", "").replace("TARGET", "target-sender: 9")
    replay += PRINTED.replace(
        "opendlv.proxy.GroundSteeringRequest}", "opendlv.proxy.GroundSteeringRequest, sender: 9}", 1
    )
    (problem,) = [p for p in found(check_producers, replay, tmp_path) if p[0] == "two-producers"]
    assert problem[1] == f"the application's 'driver' prints {STEERING}/9, by which 'track' judges it"
    assert f"{STEERING}/9=drive" in senders(resolved(replay, tmp_path))


def test_what_is_printed_comes_from_the_runner_alone(tmp_path: Path) -> None:
    words = senders(resolved(PRINTED, tmp_path))
    assert {f"{STEERING}/0=dodo-lines", "opendlv.logic.perception.DetectionType/9=dodo-lines"} <= set(words)
    assert not any(word.startswith("opendlv.proxy.PedalPositionRequest") for word in words)
