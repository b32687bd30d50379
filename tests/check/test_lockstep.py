"""Steps and answers derived from a test's wiring."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.check.wiring import (
    DEFAULT_HZ,
    End,
    Wiring,
    answers,
    cameras_of,
    message,
    other_inputs,
    rates,
    rates_fit,
    step_hz,
)
from dodo_dsl.check.wiring_rules import check_producers
from dodo_dsl.diagnostics import Span
from tests.check.contexts import context, resolved

STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"


@given(st.floats(0.1, 1000), st.integers(1, 1000))
def test_multiples_and_fractions_fit(step: float, factor: int) -> None:
    assert rates_fit(step * factor, step)
    assert rates_fit(step, step * factor)


@pytest.mark.parametrize(("rate", "step"), [(75, 10), (10, 75), (10.01, 10), (29.97, 30)])
def test_others_do_not(rate: float, step: float) -> None:
    assert not rates_fit(rate, step)


def test_the_fastest_camera_sets_the_step(tmp_path: Path) -> None:
    example = """\
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain, freq: 5 Hz}}
  other: {uses: virtual-camera, with: {freq: 20 Hz, name.argb: b.argb, name.i420: b.i420, frame-id: 0}}
"""
    test = resolved(example, tmp_path)
    found = rates(test.services)
    assert (found["camera"], found["other"]) == (5.0, 20.0)
    assert cameras_of(test.wiring) == {"camera", "other"}
    assert step_hz(test.wiring, found) == 20.0
    assert step_hz(Wiring((), ()), found) == DEFAULT_HZ


def test_what_drives_the_vehicle_answers(tmp_path: Path) -> None:
    wiring = resolved("", tmp_path).wiring
    assert answers(wiring) == [STEERING, PEDAL]
    assert other_inputs(wiring) == []


def test_what_the_application_declares_comes_first(tmp_path: Path) -> None:
    example = f"""\
# docker-compose.yml
services:
  driver: {{image: driver, command: --cid=1, x-dodo: {{out: [{STEERING}, {PEDAL}], answers: [{PEDAL}]}}}}
"""
    wiring = resolved(example, tmp_path).wiring
    assert answers(wiring) == [PEDAL]
    assert other_inputs(wiring) == [STEERING]


MOTION = "opendlv.proxy.GroundMotionRequest"


@pytest.mark.parametrize(
    ("sent", "driving"),
    [
        ([MOTION], [MOTION]),
        ([STEERING, PEDAL], [STEERING, PEDAL]),
        ([STEERING, f"{MOTION}/3"], [MOTION, STEERING]),
        (["opendlv.proxy.GroundSpeedRequest"], [STEERING, PEDAL]),
    ],
)
def test_one_message_stands_for_others(sent: list[str], driving: list[str], tmp_path: Path) -> None:
    """Where the application declares it: nothing else is required of it then, nor does it complete an answer."""
    compose = f"services: {{driver: {{image: driver, command: --cid=1, x-dodo: {{out: {sent}}}}}}}\n"
    test = context(f"# docker-compose.yml\n{compose}", tmp_path)
    assert answers(test.wiring) == driving
    missing = [d.message.split()[2].rstrip(",") for d in check_producers(test) if "'vehicle'" in d.message]
    assert missing == ([] if {MOTION, STEERING, f"{MOTION}/3"} & {*sent} else driving)
    assert all(f", or {MOTION} instead, under x-dodo.out" in d.hint for d in check_producers(test) if missing)


def test_what_is_judged_comes_last() -> None:
    judged = End("judge", "evaluation", message("opendlv.proxy.X/3", None), Span("x.yml"))
    detected = End("judge", "evaluation", message("opendlv.logic.perception.DetectionType", None), Span("x.yml"))
    assert answers(Wiring((), (judged, detected))) == ["opendlv.proxy.X/3"]
    assert answers(Wiring((), (detected,))) == []
    assert other_inputs(Wiring((), (detected,))) == [str(detected.port)]


def test_an_optional_message_is_expected_when_it_is_declared() -> None:
    optional = End("vehicle", "action", message("a.B", None, optional=True), Span("x.yml"))
    declared = End("driver", "application", message("a.B", 0), Span("x.yml"))
    assert answers(Wiring((), (optional,))) == []
    assert answers(Wiring((), (optional,), (declared,))) == ["a.B"]


def printing(messages: str, more: str = "") -> str:
    lines = [f"{{match: '(?P<x>.)', message: {name}}}" for name in messages.split()]
    return f"""\
# docker-compose.yml
services:
  driver: {{image: driver, x-dodo: {{lines: [{", ".join(lines)}]{more}}}}}
"""


@pytest.mark.parametrize(
    ("example", "expected"),
    [
        (printing(STEERING), [STEERING, PEDAL]),
        (printing("opendlv.proxy.DistanceReading"), ["opendlv.proxy.DistanceReading/0", STEERING, PEDAL]),
        (printing("opendlv.logic.perception.DetectionType"), [STEERING, PEDAL]),
        (printing(f"{STEERING} opendlv.proxy.DistanceReading", f", answers: [{PEDAL}]"), [PEDAL]),
    ],
)
def test_what_the_application_prints_answers_beside_what_is_driven_by(
    tmp_path: Path, example: str, expected: list[str]
) -> None:
    assert answers(resolved(example, tmp_path).wiring) == expected
