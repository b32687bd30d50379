"""A plan as compose files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import source
from dodo_dsl.emit import yaml as written
from dodo_dsl.emit.compose import FILES_MOUNT, layer
from dodo_dsl.plan.model import Flag, Plan, PlannedService
from tests.run.helpers import Bench

COMMON = ["tmp:/tmp", "dodo-channel:/dodo/channel"]


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


def service(plan: Plan, layer_name: str, name: str) -> dict[str, Any]:
    """What a reader sees of a service."""
    found = yaml.safe_load(written.text(layer(plan, layer_name)))["services"][name]
    return dict(found)


def test_paths_and_dollars_of_a_command(plan: Plan) -> None:
    camera = service(plan, "environment", "camera")
    assert camera["command"] == ["--map=/dodo/files/a/$$b.json", "--rec=/dodo/report/x.rec", "--cid=130"]
    assert camera["volumes"] == [*COMMON, FILES_MOUNT, "report:/dodo/report"]
    assert camera["healthcheck"]["retries"] == 125


@pytest.mark.parametrize(
    ("name", "own", "earlier"),
    [("environment", "camera", []), ("action", "vehicle", ["camera"]), ("evaluation", "judge", ["camera", "vehicle"])],
)
def test_each_layer_waits_for_those_before_it(plan: Plan, name: str, own: str, earlier: list[str]) -> None:
    waits = {each: {"condition": "service_healthy"} for each in earlier}
    found = service(plan, name, own)
    assert found["depends_on"] == {"sandbox": {"condition": "service_started"}, **waits}
    assert (found["volumes"][:2], found["ipc"]) == (COMMON, "service:sandbox")
    on_host = service(replace(plan, isolation="host"), name, own)
    assert (on_host["depends_on"], on_host["volumes"][0], on_host["network_mode"]) == (waits, "/tmp:/tmp", "host")


def test_environment_has_what_has_a_value(plan: Plan) -> None:
    own = {"DODO_CHANNEL": "/dodo/channel", "DODO_SERVICE": "vehicle"}
    assert service(plan, "action", "vehicle")["environment"] == own
    vehicle = service(replace(plan, messages=("a.odvd", "b.odvd"), rig="desk"), "action", "vehicle")
    messages = {"DODO_ODVD": "/dodo/files/a.odvd:/dodo/files/b.odvd", "DODO_RIG": "desk"}
    assert vehicle["environment"] == {**own, **messages}
    assert FILES_MOUNT in vehicle["volumes"], "the messages are there"


def test_only_the_service_that_moves_the_rig_may_open_terminals(plan: Plan) -> None:
    port = "/dev/ttyACM0"
    services = (
        PlannedService("action", "pose", "x", "image", (), devices=(port,), port=port),
        PlannedService("action", "camera", "x", "image", (), devices=("/dev/video0",)),
        PlannedService("action", "vehicle", "x", "image", ()),
    )
    found = [service(replace(plan, services=services), "action", each.name) for each in services]
    assert [(each.get("devices"), each.get("group_add")) for each in found] == [
        ([port], ["dialout"]),
        (["/dev/video0"], ["video"]),
        (None, None),
    ]


def test_a_service_sees_the_shared_files_of_its_own_paths(plan: Plan) -> None:
    map_, other = f"{'0' * 64}-b.json", f"{'1' * 64}-other.rec"
    camera = service(replace(plan, shared={"a/$b.json": map_, "a/$b.json2": other}), "environment", "camera")
    mount = {**FILES_MOUNT, "source": f"../_files/{map_}", "target": f"/_files/{map_}"}
    assert camera["volumes"] == [*COMMON, FILES_MOUNT, mount, "report:/dodo/report"]


_WORDS = "on No null 1e3 0x1 1:20 a: -x --x=1 *a &a !a %a @a << ./a .. .5 /a é 2020-01-01 --x=a,b --path=/a/$$b"
_TEXTS = [
    "", " a", "a ", "a b", "a: b", "a #b", "a\nb", "a\u2028b", "a\x85\x7fb", "🚗" * 60, "--x=[1, {a: b}]",
    "r.example.org:5/a/b@sha256:12",
]  # fmt: skip


def test_every_reader_takes_a_value_for_the_same() -> None:
    """That of YAML 1.1, as of Python and Ruby, and that of 1.2; on one line and in several."""
    words = [*_WORDS.split(), *_TEXTS]
    keys = [word for word in words if word != "<<"]
    value = {
        "short": [*words, {"a": "b,c", "source": "./a: b", "c": True, "d": None, "e": 0.5}],
        "by words": dict.fromkeys(keys, "x" * 60),
        "long": {"a": [{"b": word, "c": []} for word in words], "d": {}},
        "one": {word: {word: word} for word in keys},
    }
    text = written.text(value)
    assert yaml.safe_load(text) == value
    node, problems = source.parse(text, "words")
    assert not problems and node is not None and source.plain(node) == value
