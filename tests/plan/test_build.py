"""From tests without errors to Plans."""

import json
from pathlib import Path

import pytest

from dodo_dsl.plan.build import Compiled, build, isolation
from dodo_dsl.plan.model import Flag, Place, Plan
from dodo_dsl.spec.load import Settings
from dodo_dsl.spec.rig import Rig, emulated
from tests.check.contexts import checked, resolved
from tests.source.nodes import mapping

KIWI = Rig("kiwi", "static", 121, mapping("kind: static"))


def built(example: str, folder: Path, settings: Settings = Settings()) -> Compiled:  # noqa: B008
    found = checked(example, folder)
    assert found.ok and found.application is not None, found.diagnostics
    tests = [test for test in found.tests if test.spec.location.stem == "example"]
    return build(tests, found.manifests, found.deployment, found.application, folder / "generated", settings)


def plan(example: str, folder: Path) -> Plan:
    return built(example, folder).suite.plans[0]


def test_a_plan(tmp_path: Path) -> None:
    found = plan("", tmp_path)
    assert (found.name, found.slug, found.level, found.clock) == ("example", "example", "sil", "realtime")
    assert (found.timeout_s, found.cid, found.isolation, found.subnet) == (60.0, 128, "network", "10.213.185.240/28")
    assert (found.tag, found.rig, found.lockstep, found.spec) == ("sil", "", None, "tests/example/example.dodo.yml")
    assert [service.name for service in found.services] == ["dodo-recorder", "camera", "vehicle", "pose", "track"]
    assert [service.judge for service in found.services] == [False, False, False, False, True]
    camera = {flag.name: flag for flag in found.services[1].flags}
    assert camera["map-path"] == Flag("map-path", "maps/plain", "path")
    assert camera["cid"] == Flag("cid", "128")
    assert found.source_map["environment.camera.map-path"] == Place("tests/example/example.dodo.yml", 8, 41)


def test_files_of_a_test(tmp_path: Path) -> None:
    (tmp_path / "tests" / "maps" / "plain").mkdir(parents=True)
    (tmp_path / "tests" / "maps" / "plain" / "a.mtl").touch()
    camera = "environment:\n  camera: {uses: virtual-camera, with: {map-path: ../maps/plain/map.json}}\n"
    own = camera + "# dodo.yml\nmessages: [my.odvd]\n# my.odvd\nmessage my.Own [id = 3000] { float x [id = 1]; }\n"
    compiled = built(own, tmp_path)
    targets = [copy.target for copy in compiled.copies["example"]]
    assert targets == ["maps/plain/a.mtl", "maps/plain/map.json", "messages/0-my.odvd"], "a map goes with its folder"
    assert compiled.suite.plans[0].messages == ("messages/0-my.odvd",)


def test_a_test_in_lockstep_has_a_clock(tmp_path: Path) -> None:
    found = plan("clock: lockstep\n", tmp_path)
    assert [service.name for service in found.services][:2] == ["dodo-recorder", "dodo-clock"]
    assert found.lockstep is not None


def test_instances_in_the_order_of_their_names(tmp_path: Path) -> None:
    matrix = "matrix: {yaw: [90 deg, 80 deg]}\ndescription: At ${matrix.yaw}.\n"
    assert [(p.slug, p.cid) for p in built(matrix, tmp_path).suite.plans] == [
        ("example--yaw-80-deg", 128),
        ("example--yaw-90-deg", 129),
    ]


def test_a_rig_has_its_own_cid(tmp_path: Path) -> None:
    found = plan("level: hil\nrig: kiwi\n# dodo.yml\nrigs: {kiwi: {kind: dynamic, cid: 130}}\n", tmp_path)
    assert (found.cid, found.isolation, found.subnet, found.tag) == (130, "host", "", "hil-dynamic")


def test_an_emulated_rig_has_a_virtual_camera(tmp_path: Path) -> None:
    example = """\
level: hil
rig: emulated
environment: {camera: {uses: camera}}
evaluation: {track: {uses: collision, with: {map-path: ../maps/plain, goal: finish}}}
"""
    found = plan(example, tmp_path)
    assert (found.isolation, found.tag, found.is_real, found.lacks_rig) == ("network", "hil-dynamic", False, False)
    assert [s.uses for s in found.services if s.name == "camera"] == ["virtual-camera"]
    assert "environment.camera.source" not in found.source_map


def test_a_cid_that_is_built_in_is_that_of_each_test(tmp_path: Path) -> None:
    example = (
        "name: example\nmatrix: {light: [1, 2]}\n# dodo.yml\ncids: 128-128\n# docker-compose.yml\n"
        "services: {driver: {image: driver, x-dodo: {cid: 111}}}\n"
    )
    assert [each.cid for each in built(example, tmp_path).suite.plans] == [111, 111]


def test_images_of_the_deployment(tmp_path: Path) -> None:
    found = plan("# dodo.yml\nimages: {prefix: registry.example.org/dodo, tag: '7'}\n", tmp_path)
    assert found.sandbox_image == "registry.example.org/dodo/sandbox:7"


def test_equal_input_gives_equal_plans(tmp_path: Path) -> None:
    assert built("", tmp_path) == built("", tmp_path)


@pytest.mark.parametrize(
    ("written", "rig", "expected"),
    [
        ("", None, "network"),
        ("isolation: host\n", None, "host"),
        ("", KIWI, "host"),
        ("", emulated(), "network"),
        ("isolation: host\n", emulated(), "host"),
    ],
)
def test_isolation(written: str, rig: Rig | None, expected: str, tmp_path: Path) -> None:
    assert isolation(resolved(written, tmp_path).spec, rig) == expected


JUDGE = {
    "name": "judge",
    "layers": ["evaluation"],
    "image": "judge",
    "process": ["judge"],
    "description": "Judges.",
    "parameters": {"wait": {"type": "number", "unit": "s", "help": "Wait.", "setup-times": 2}},
}


def test_time_to_get_ready(tmp_path: Path) -> None:
    files = f"# dodo.yml\nservices: [own]\n# own/judge/service.yml\n{json.dumps(JUDGE)}\n"
    found = plan(f"evaluation: {{own: {{uses: judge, with: {{wait: 30 s}}}}}}\n{files}", tmp_path)
    assert found.services[-1].setup_s == 60.0


def test_where_own_services_are_found(tmp_path: Path) -> None:
    """Relative to the compiled test, so that the output is the same on any machine."""
    files = f"# dodo.yml\nservices: [own, deep/more]\n# own/judge/service.yml\n{json.dumps(JUDGE)}\n# deep/more/\n"
    found = plan(f"evaluation: {{own: {{uses: judge, with: {{wait: 30 s}}}}}}\n{files}", tmp_path)
    assert found.import_paths == ("../..", "../../deep")
    assert plan("", tmp_path).import_paths == ()
