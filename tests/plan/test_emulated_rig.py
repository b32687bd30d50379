"""The virtual camera of an emulated rig."""

from dodo_dsl.plan.added_services import hardware
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.spec.manifest import load_manifests

MANIFESTS, _ = load_manifests()


def camera(source: str, **flags: str) -> PlannedService:
    given = (Flag("source", source), *(Flag(name, value) for name, value in flags.items()), Flag("cid", "140"))
    return PlannedService("environment", "eye", "camera", "dodo/camera:1", ("camera",), given)


def test_hardware_stays() -> None:
    for service in (camera("/dev/video0"), PlannedService("action", "pose", "gantry", "dodo/gantry:1", ("gantry",))):
        assert hardware(service, MANIFESTS, "dodo/virtual-camera:1") is service


def test_an_emulated_camera_is_drawn() -> None:
    found = hardware(
        camera(
            "emulated",
            **{
                "width": "640",
                "freq": "10",
                "name.bgr": "video0.bgr",
                "exposure": "0.02",
                "scene.light": "0.5",
                "file": "x",
                "scene.truth-sender": "9",
            },
        ),
        MANIFESTS,
        "dodo/virtual-camera:1",
    )
    drawn = MANIFESTS["virtual-camera"]
    assert (found.name, found.uses, found.image) == ("eye", "virtual-camera", "dodo/virtual-camera:1")
    assert found.process == drawn.process
    assert {flag.name: flag.value for flag in found.flags} == {
        "width": "640",
        "freq": "10",
        "name.bgr": "video0.bgr",
        "cid": "140",
        "shutter": "0.02",
        "exposure": "0.5",
        "truth-sender": "9",
        "start-x": "0",
        "start-y": "0",
        "start-yaw": "0",
    }
    assert {flag.name for flag in found.flags} <= {*drawn.parameters, "cid"}
