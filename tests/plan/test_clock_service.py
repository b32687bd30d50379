"""The clock of a test in lockstep."""

from pathlib import Path

import pytest

from dodo_dsl.application.model import Declared
from dodo_dsl.diagnostics import Span
from dodo_dsl.plan.added_services import CLOCK, clock, lockstep
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.spec.manifest import load_manifests
from tests.check.contexts import resolved

MANIFEST = load_manifests()[0]["clock"]
ORDER = """\
clock: lockstep
environment:
  second: {uses: virtual-camera, with: {freq: 20 Hz, name.argb: b.argb, name.i420: b.i420}}
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}
action:
  pose: {uses: integrator}
  vehicle: {uses: dynamic-model}
"""


def own(readers: int) -> Declared:
    return Declared((), (), (), None, readers, Span("x.yml"))


def flags(example: str, folder: Path) -> dict[str, str]:
    service = clock(resolved(example, folder), MANIFEST, "dodo/clock:1", ("dodo-recorder",), 140, ("driver", "eye"))
    assert (service.layer, service.name, service.uses, service.judge) == ("environment", CLOCK, "clock", False)
    return {flag.name: flag.value for flag in service.flags}


def test_services_step_after_those_that_they_consume_from(tmp_path: Path) -> None:
    found = flags(ORDER, tmp_path)
    assert (found["advance"], found["sense"], found["judge"]) == ("vehicle,pose", "second,camera", "track")
    assert (found["freq"], found["timeout"], found["cid"], found["watch"]) == ("20", "60", "140", "dodo-recorder")
    assert found["answers"] == "opendlv.proxy.GroundSteeringRequest,opendlv.proxy.PedalPositionRequest"
    assert (found["application"], found["time-folder"]) == ("driver,eye", "/dev/shm/dodo-time")
    assert "hears" not in found
    assert "done" not in found


def test_what_the_application_declares(tmp_path: Path) -> None:
    example = """\
clock: lockstep
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=1
    x-dodo:
      out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]
      answers: [opendlv.proxy.PedalPositionRequest]
      done: opendlv.proxy.ImageReadingShm
"""
    found = flags(example, tmp_path)
    assert (found["answers"], found["hears"], found["done"]) == (
        "opendlv.proxy.PedalPositionRequest",
        "opendlv.proxy.GroundSteeringRequest",
        "opendlv.proxy.ImageReadingShm",
    )


@pytest.mark.parametrize(
    ("declared", "wall_timeout_s", "expected"),
    [
        ({}, None, Lockstep(1, 660.0)),
        ({"a": None, "b": own(2), "c": own(1)}, None, Lockstep(3, 660.0)),
        ({"a": own(0)}, 5.0, Lockstep(1, 5.0)),
    ],
)
def test_readers_and_wall_time(
    declared: dict[str, Declared | None], wall_timeout_s: float | None, expected: Lockstep, tmp_path: Path
) -> None:
    spec = resolved("clock: lockstep\n", tmp_path).spec
    assert lockstep(spec, declared, wall_timeout_s) == expected


def test_none_in_real_time(tmp_path: Path) -> None:
    assert lockstep(resolved("", tmp_path).spec, {"a": own(2)}) is None
