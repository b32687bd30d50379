"""A planned service as a container."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.emit.containers import FILES_MOUNT, containers
from dodo_dsl.plan.model import Flag, Plan, PlannedService
from tests.run.helpers import Bench


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    """A service in each layer, under network isolation."""
    flags = (
        Flag("map", "a/$b.json", "path"),
        Flag("rec", "x.rec", "report"),
        Flag("cid", "130"),
    )
    services = (
        PlannedService("environment", "camera", "x", "image", (), flags, setup_s=2.5),
        PlannedService("action", "vehicle", "x", "image", ()),
        PlannedService("evaluation", "judge", "x", "image", (), judge=True),
    )
    return replace(Bench(tmp_path).plan(), isolation="network", services=services)


def test_paths_and_dollars_of_a_command(plan: Plan) -> None:
    (camera,) = containers(plan, "environment")
    assert camera.command == ("--map=/dodo/files/a/$$b.json", "--rec=/dodo/report/x.rec", "--cid=130")
    assert camera.volumes == ("tmp:/tmp", FILES_MOUNT, "report:/dodo/report")
    assert (camera.ready_file, camera.ready_tries) == ("/tmp/dodo-ready-camera", 125)


@pytest.mark.parametrize(
    ("layer", "earlier"), [("environment", []), ("action", ["camera"]), ("evaluation", ["camera", "vehicle"])]
)
def test_each_layer_waits_for_those_before_it(plan: Plan, layer: str, earlier: list[str]) -> None:
    waits = [(name, "service_healthy") for name in earlier]
    (found,) = containers(plan, layer)
    assert found.after == (("sandbox", "service_started"), *waits)
    (on_host,) = containers(replace(plan, isolation="host"), layer)
    assert on_host.after == tuple(waits)
    assert on_host.volumes[0] == "/tmp:/tmp"


def test_environment_has_what_has_a_value(plan: Plan) -> None:
    (vehicle,) = containers(plan, "action")
    assert vehicle.environment == (("DODO_SERVICE", "vehicle"),)
    (vehicle,) = containers(replace(plan, messages=("a.odvd", "b.odvd"), rig="desk"), "action")
    assert dict(vehicle.environment) == {
        "DODO_SERVICE": "vehicle",
        "DODO_ODVD": "/dodo/files/a.odvd:/dodo/files/b.odvd",
        "DODO_RIG": "desk",
    }
    assert FILES_MOUNT in vehicle.volumes, "the messages are there"


def test_only_the_service_that_moves_the_rig_may_open_terminals(plan: Plan) -> None:
    port = "/dev/ttyACM0"
    services = (
        PlannedService("action", "pose", "x", "image", (), devices=(port,), port=port),
        PlannedService("action", "camera", "x", "image", (), devices=("/dev/video0",)),
        PlannedService("action", "vehicle", "x", "image", ()),
    )
    found = containers(replace(plan, services=services), "action")
    assert [(c.devices, c.groups) for c in found] == [
        ((port,), ("dialout",)),
        (("/dev/video0",), ("video",)),
        ((), ()),
    ]


def test_a_service_sees_the_shared_files_of_its_own_paths(plan: Plan) -> None:
    map_, other = f"{'0' * 64}-b.json", f"{'1' * 64}-other.rec"
    (camera,) = containers(replace(plan, shared={"a/$b.json": map_, "a/$b.json2": other}), "environment")
    mount = {**FILES_MOUNT, "source": f"../_files/{map_}", "target": f"/_files/{map_}"}
    assert camera.volumes == ("tmp:/tmp", FILES_MOUNT, mount, "report:/dodo/report")
