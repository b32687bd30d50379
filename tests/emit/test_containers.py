"""A planned service as a container."""

from dataclasses import replace
from pathlib import Path

import pytest
from dodo_dsl.emit.containers import FILES_MOUNT, Defaults, Variable, containers

from dodo_dsl.plan.model import Flag, Place, Plan, PlannedService
from tests.run.helpers import Bench

MEET = "dodo-channel:/dodo/channel"


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
    (camera,) = containers(plan, "environment").services
    assert camera.command == ("--map=/dodo/files/a/$$b.json", "--rec=/dodo/report/x.rec", "--cid=130")
    assert camera.volumes == ("tmp:/tmp", MEET, FILES_MOUNT, "report:/dodo/report")
    assert camera.ready_tries == 125


@pytest.mark.parametrize(
    ("layer", "earlier"), [("environment", []), ("action", ["camera"]), ("evaluation", ["camera", "vehicle"])]
)
def test_each_layer_waits_for_those_before_it(plan: Plan, layer: str, earlier: list[str]) -> None:
    waits = [(name, "service_healthy") for name in earlier]
    found = containers(plan, layer)
    assert (found.after, found.volumes) == ((("sandbox", "service_started"), *waits), ("tmp:/tmp", MEET))
    on_host = containers(replace(plan, isolation="host"), layer)
    assert (on_host.after, on_host.volumes) == (tuple(waits), ("/tmp:/tmp", MEET))
    assert on_host.services[0].volumes[0] == "/tmp:/tmp"


def test_environment_has_what_has_a_value(plan: Plan) -> None:
    layer = containers(plan, "action")
    meet = Variable("DODO_CHANNEL", "/dodo/channel")
    assert (layer.environment, layer.services[0].environment) == ((meet,), (Variable("DODO_SERVICE", "vehicle"),))
    layer = containers(replace(plan, messages=("a.odvd", "b.odvd"), rig="desk"), "action")
    assert {each.name: each.value for each in layer.environment} == {
        "DODO_ODVD": "/dodo/files/a.odvd:/dodo/files/b.odvd",
        "DODO_RIG": "desk",
        "DODO_CHANNEL": "/dodo/channel",
    }
    assert FILES_MOUNT in layer.services[0].volumes, "the messages are there"


def test_a_flag_at_its_default_is_there_where_the_spec_has_it(plan: Plan) -> None:
    place = Place("spec", 1, 1)
    flags = (Flag("size", "3"), Flag("freq", "10"), Flag("noise", "0"), Flag("cid", "130"))
    camera = PlannedService("environment", "camera", "x", "image", (), flags)
    written = replace(
        plan, services=(camera,), source_map={"environment.camera": place, "environment.camera.freq": place}
    )
    defaults = {"x": {"size": "2", "freq": "10", "noise": "0"}}

    def command(plan: Plan, defaults: Defaults) -> list[str]:
        return [word.partition("=")[0] for word in containers(plan, "environment", defaults).services[0].command]

    assert command(written, defaults) == ["--size", "--freq", "--cid"]
    assert command(written, {"y": defaults["x"]}) == ["--size", "--freq", "--noise", "--cid"]
    added = replace(written, source_map={})
    assert command(added, defaults) == ["--size", "--freq", "--noise", "--cid"], "the compiler has decided them"


def test_a_long_list_has_a_line_for_each_word() -> None:
    words = [f"opendlv.sim.Frame/{number}=pose" for number in range(5)]
    assert Variable("DODO_SENDERS", " ".join(words)).lines == tuple(words)
    for value in ("short list", f"{'x' * 200}  y", f" {'x' * 200}"):
        assert Variable("DODO_SENDERS", value).lines == ()


def test_only_the_service_that_moves_the_rig_may_open_terminals(plan: Plan) -> None:
    port = "/dev/ttyACM0"
    services = (
        PlannedService("action", "pose", "x", "image", (), devices=(port,), port=port),
        PlannedService("action", "camera", "x", "image", (), devices=("/dev/video0",)),
        PlannedService("action", "vehicle", "x", "image", ()),
    )
    found = containers(replace(plan, services=services), "action").services
    assert [(c.devices, c.groups) for c in found] == [
        ((port,), ("dialout",)),
        (("/dev/video0",), ("video",)),
        ((), ()),
    ]


def test_a_service_sees_the_shared_files_of_its_own_paths(plan: Plan) -> None:
    map_, other = f"{'0' * 64}-b.json", f"{'1' * 64}-other.rec"
    (camera,) = containers(replace(plan, shared={"a/$b.json": map_, "a/$b.json2": other}), "environment").services
    mount = {**FILES_MOUNT, "source": f"../_files/{map_}", "target": f"/_files/{map_}"}
    assert camera.volumes == ("tmp:/tmp", MEET, FILES_MOUNT, mount, "report:/dodo/report")
