"""Instances resolved once: rigs, manifests, arguments and wiring."""

from pathlib import Path

import pytest

from dodo_dsl.check.resolve import resolve
from dodo_dsl.check.wiring import answers, driving
from tests.check.contexts import checked, resolved


def test_the_rig(tmp_path: Path) -> None:
    found = checked("level: hil\nrig: emulated\n", tmp_path)
    specs = [test.spec for test in found.tests]
    tests = resolve(specs, found.manifests, found.deployment, None)
    assert [test.spec for test in tests] == specs
    assert [test.rig.name if test.rig else None for test in tests] == [None, "emulated"]
    assert all(test.is_complete for test in tests)
    assert not tests[0].wiring.has_application


PEDAL, AXLE, STEERING, SPEED = (
    f"opendlv.proxy.{name}Request" for name in ("PedalPosition", "AxleAngularVelocity", "GroundSteering", "GroundSpeed")
)
KIWI = [STEERING, PEDAL]


@pytest.mark.parametrize(
    ("parameters", "requests"),
    [
        ("", KIWI),
        ("drive: kiwi", KIWI),
        ("drive: differential", [f"{PEDAL}/0", f"{PEDAL}/1"]),
        ("drive: differential, wheel-input: axle", [f"{AXLE}/0", f"{AXLE}/1"]),
        ("drive: bicycle", [SPEED, STEERING]),
    ],
)
def test_what_drives_a_vehicle_is_what_it_takes(tmp_path: Path, parameters: str, requests: list[str]) -> None:
    example = f"action: {{vehicle: {{uses: dynamic-model, with: {{{parameters}}}}}, pose: {{uses: integrator}}}}\n"
    test = resolved(example, tmp_path)
    assert answers(test.wiring) == driving(test.wiring) == requests
    (track,) = (service for service in test.services if service.use.name == "track")
    assert track.texts["requests"] == ",".join(requests)
    assert {str(end.port) for end in test.wiring.consumed if end.service == "track"} >= set(requests)


def test_requests_that_are_written_stay(tmp_path: Path) -> None:
    example = f"""\
action: {{vehicle: {{uses: dynamic-model, with: {{drive: differential}}}}, pose: {{uses: integrator}}}}
evaluation: {{track: {{uses: collision, with: {{goal: finish, requests: [{PEDAL}/1]}}}}}}
"""
    (track,) = (service for service in resolved(example, tmp_path).services if service.use.name == "track")
    assert track.texts["requests"] == f"{PEDAL}/1"


@pytest.mark.parametrize(
    ("goal", "written", "expected"),
    [("goal: finish, gates: [a, b, a]", "", "finish,a,b"), ("min-distance: 1 m", "", ""), ("goal: finish", "[]", "")],
)
def test_goals_and_gates_are_no_walls_of_sensors(tmp_path: Path, goal: str, written: str, expected: str) -> None:
    own = f", not-walls: {written}" if written else ""
    example = f"""\
environment: {{scan: {{uses: lidar, with: {{map-path: map, walls: ['*']{own}}}}}}}
evaluation: {{track: {{uses: collision, with: {{{goal}}}}}}}
"""
    (scan,) = (service for service in resolved(example, tmp_path).services if service.use.name == "scan")
    assert scan.texts["not-walls"] == expected


def test_instances_of_a_matrix_of_drives_have_the_parameters_of_their_own(tmp_path: Path) -> None:
    example = """\
matrix: {drive: [kiwi, differential]}
action: {vehicle: {uses: dynamic-model, with: {drive: "${matrix.drive}"}}, pose: {uses: integrator}}
"""
    tests = [test for test in checked(example, tmp_path).tests if test.spec.location.stem == "example"]
    texts = [service.texts for test in tests for service in test.services if service.use.name == "vehicle"]
    assert [("track" in each, "steering-offset" in each) for each in texts] == [(False, True), (True, False)]
    assert [len(answers(test.wiring)) for test in tests] == [2, 2]
