"""Parameters against the manifest, with values of other services and of the rig."""

from pathlib import Path

import pytest

from dodo_dsl.check.service_rules import check_parameters
from tests.check.contexts import context, found

CAMERA = "environment: {{camera: {{uses: virtual-camera, with: {{{values}}}}}}}\n"


@pytest.mark.parametrize(
    ("values", "rules"),
    [
        ("map-path: ../maps/plain", []),
        ("map-path: ../maps/plain, freq: 10 Hz", []),
        ("map-path: ../maps/plain, fre: 10 Hz", ["unknown-parameter"]),
        ("map-path: ../maps/plain, freq: 10", ["wrong-unit"]),
        ("map-path: ../maps/plain, width: wide", ["wrong-type"]),
        ("map-path: ../maps/plain, freq: 0 Hz", ["out-of-range"]),
        ("map-path: ../maps/none", ["missing-file", "missing-file"]),
        ("map-path: /etc", ["path-escape", "path-escape"]),
    ],
)
def test_written_values(values: str, rules: list[str], tmp_path: Path) -> None:
    """The evaluator shares the map, so a wrong one is wrong for both."""
    assert [rule for rule, _ in found(check_parameters, CAMERA.format(values=values), tmp_path)] == rules


def test_a_required_value(tmp_path: Path) -> None:
    problems = list(check_parameters(context(CAMERA.format(values=""), tmp_path)))
    assert [problem.rule for problem in problems] == ["missing-parameter", "missing-parameter"]
    assert problems[0].message.startswith("service 'virtual-camera' needs parameter 'map-path': ")
    assert problems[0].hint == "write 'map-path: ...' under 'with'"


def test_two_services_that_share_different_values(tmp_path: Path) -> None:
    example = """\
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}
  other: {uses: virtual-camera, with: {map-path: ../maps, name.argb: b.argb, name.i420: b.i420, frame-id: 1}}
"""
    (problem,) = check_parameters(context(example, tmp_path))
    assert problem.hint == "camera and other give different values, so write the one to use"


def test_values_of_the_rig(tmp_path: Path) -> None:
    example = """\
level: hil
rig: kiwi
environment: {camera: {uses: camera}}
# dodo.yml
rigs: {kiwi: {kind: static, cid: 121CAMERA}}
"""
    missing = {message.split("'")[3] for _, message in found(check_parameters, example.replace("CAMERA", ""), tmp_path)}
    assert missing == {"source", "map-path"}
    given = example.replace("CAMERA", ", camera: {source: /dev/video0, width: 640, height: 480}")
    assert {message.split("'")[3] for _, message in found(check_parameters, given, tmp_path)} == {"map-path"}


@pytest.mark.parametrize(
    ("values", "problems"),
    [
        ("yaw: 90 deg", []),
        ("yaw: [0 deg, 90 deg]", []),
        (
            "yaw: [0 deg, 90 deg, 180 deg]",
            [("wrong-value", "parameter 'yaw' has 3 items, expected one, or 2 as 'id' has")],
        ),
        ("walls: [left, right, finish]", []),
    ],
)
def test_lists_that_belong_together(values: str, problems: list[tuple[str, str]], tmp_path: Path) -> None:
    example = (
        f"environment: {{ranges: {{uses: range-finder, with: {{map-path: ../maps/plain, id: [0, 2], {values}}}}}}}\n"
    )
    assert found(check_parameters, example, tmp_path) == problems
