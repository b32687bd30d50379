"""Producers of what services consume."""

from pathlib import Path

import pytest

from dodo_dsl.check.wiring_rules import check_producers
from tests.check.contexts import context, found

APPLICATION = """\
# docker-compose.yml
services: {{driver: {{image: driver, command: --cid=1, x-dodo: {{in: [{consumed}], out: [{produced}]}}}}}}
"""
STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"
BOTH = f"{STEERING}, {PEDAL}"
CAMERA = "environment: {{camera: {{uses: virtual-camera, with: {{map-path: ../maps/plain, {more}}}}}}}\n"


@pytest.mark.parametrize("example", ["", APPLICATION.format(consumed="", produced=BOTH)])
def test_everything_is_produced(example: str, tmp_path: Path) -> None:
    assert found(check_producers, example, tmp_path) == []


@pytest.mark.thorough
def test_a_sender_stamp_that_no_service_sends(tmp_path: Path) -> None:
    (problem,) = check_producers(context(CAMERA.format(more="frame-id: 7"), tmp_path))
    assert (problem.rule, problem.hint) == ("no-producer", "the test sends opendlv.sim.Frame/0")


def test_a_sample_that_no_service_sends(tmp_path: Path) -> None:
    example = "evaluation: {track: {uses: collision, with: {goal: finish, frame-id: 1}}}\n"
    (problem,) = check_producers(context(example, tmp_path))
    assert problem.rule == "no-sample"
    assert problem.message.endswith(", which no service of the test sends, so it could never judge")


def test_a_service_that_could_send_it(tmp_path: Path) -> None:
    problems = list(check_producers(context("action: {vehicle: {uses: dynamic-model}}\n", tmp_path)))
    assert {problem.rule for problem in problems} == {"no-producer", "no-sample"}
    assert problems[0].message == "'camera' needs opendlv.sim.Frame/0, which no service of the test sends"
    assert problems[0].hint == "add a service that sends it: beacon, gantry, integrator"


def test_messages_that_the_application_does_not_declare(tmp_path: Path) -> None:
    (problem,) = check_producers(context(APPLICATION.format(consumed="", produced=STEERING), tmp_path))
    assert problem.rule == "no-producer"
    assert problem.message == f"'vehicle' needs {PEDAL}, which no service of the test or the application sends"


def test_a_misspelt_message_may_be_the_one_needed(tmp_path: Path) -> None:
    assert (
        found(check_producers, APPLICATION.format(consumed="", produced=f"{STEERING}, opendlv.proxy.Pedal"), tmp_path)
        == []
    )


def test_two_services_that_send_the_same(tmp_path: Path) -> None:
    example = "action: {vehicle: {uses: dynamic-model}, pose: {uses: integrator}, ghost: {uses: integrator}}\n"
    assert found(check_producers, example, tmp_path) == [
        ("two-producers", "'pose' and 'ghost' both send opendlv.sim.Frame/0")
    ]


def test_the_application_and_a_service_that_send_the_same(tmp_path: Path) -> None:
    ((rule, message),) = found(
        check_producers, APPLICATION.format(consumed="", produced=f"{BOTH}, opendlv.sim.Frame"), tmp_path
    )
    assert (rule, message) == ("two-producers", "'pose' and the application's 'driver' both send opendlv.sim.Frame/0")


def test_the_application_consumes_what_no_service_sends(tmp_path: Path) -> None:
    example = APPLICATION.format(consumed="opendlv.proxy.DistanceReading, opendlv.sim.Frame", produced=BOTH)
    (problem,) = check_producers(context(example, tmp_path))
    assert (problem.rule, problem.severity) == ("application-input", "warning")


def test_other_rules_come_first(tmp_path: Path) -> None:
    assert found(check_producers, "evaluation: {track: {uses: collide}}\n", tmp_path) == []
    assert found(check_producers, "environment: {pose: {uses: integrator}}\n", tmp_path) == []


@pytest.mark.parametrize(
    ("consumed", "line"),
    [
        ("opendlv.proxy.DistanceReading", "id: [0, 2]"),
        ("opendlv.proxy.VoltageReading/3", "id: [3], message: opendlv.proxy.VoltageReading"),
    ],
)
def test_the_line_of_a_sensor_that_the_application_hears(consumed: str, line: str, tmp_path: Path) -> None:
    """The camera has the map already."""
    example = CAMERA.format(more="z: 9 cm") + APPLICATION.format(consumed=consumed, produced=BOTH)
    problems = [one for one in check_producers(context(example, tmp_path)) if one.rule == "application-input"]
    assert [one.hint for one in problems] == [
        f"add under 'environment': range-finder: {{uses: range-finder, with: {{{line}}}}}"
    ]


def test_a_sensor_sends_what_the_application_hears(tmp_path: Path) -> None:
    ranges = "environment: {ranges: {uses: range-finder, with: {map-path: ../maps/plain, id: [0, 2]}}}\n"
    heard = "opendlv.proxy.DistanceReading/0, opendlv.proxy.DistanceReading/2"
    assert found(check_producers, ranges + APPLICATION.format(consumed=heard, produced=BOTH), tmp_path) == []
    (problem,) = check_producers(context(ranges + APPLICATION.format(consumed=heard + "1", produced=BOTH), tmp_path))
    assert "consumes opendlv.proxy.DistanceReading/21" in problem.message
