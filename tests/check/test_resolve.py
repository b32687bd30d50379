"""Instances resolved once: rigs, manifests, arguments and wiring."""

from pathlib import Path

from dodo_dsl.check.resolve import resolve
from tests.check.contexts import checked, resolved

MATRIX = """\
matrix: {yaw: [80 deg, 90 deg]}
action:
  vehicle: {uses: dynamic-model}
  pose: {uses: integrator, with: {yaw: "${matrix.yaw}"}}
"""


def test_instances_share_what_does_not_depend_on_the_matrix(tmp_path: Path) -> None:
    one, other = (test for test in checked(MATRIX, tmp_path).tests if test.spec.location.stem == "example")
    (camera, _, pose, track), (other_camera, _, other_pose, other_track) = one.services, other.services
    assert other_camera.arguments["map-path"] is camera.arguments["map-path"]
    assert other_track.arguments["map-path"] is track.arguments["map-path"]
    assert (pose.texts["yaw"], other_pose.texts["yaw"]) == ("80", "90")
    assert other_pose.arguments["x"] == pose.arguments["x"]


def test_a_service_without_manifest_is_left_out(tmp_path: Path) -> None:
    test = resolved("evaluation: {track: {uses: collide}}\n", tmp_path)
    assert [service.use.name for service in test.services] == ["camera", "vehicle", "pose"]
    assert not test.is_complete


def test_the_rig(tmp_path: Path) -> None:
    found = checked("level: hil\nrig: emulated\n", tmp_path)
    specs = [test.spec for test in found.tests]
    tests = resolve(specs, found.manifests, found.deployment, None)
    assert [test.spec for test in tests] == specs
    assert [test.rig.name if test.rig else None for test in tests] == [None, "emulated"]
    assert all(test.is_complete for test in tests)
    assert not tests[0].wiring.has_application
