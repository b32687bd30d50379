"""A compiled test as compose shows it, judged before anything is created."""

from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.application.access.findings import CompiledTest, compiled_findings
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import Access, shown
from dodo_dsl.application.access.value_findings import short_name

FOLDER = Path("/builds/team")
NOTHING = Access()


def found(service: dict[str, Any], access: Access = NOTHING, own_network: bool = True, **rest: Any) -> list[str]:
    """The places of what is refused in a test of two services."""
    test = CompiledTest(["driver"], ["judge"], ["dodo/judge:1"], own_network, access, HostPaths(FOLDER, (FOLDER,)))
    own = {"privileged": True, "volumes": [{"type": "bind", "source": "/", "target": "/host"}]}
    config = {"name": "dodo-t", "services": {"driver": {"image": "x", **service}, "judge": own}, **rest}
    return [shown(finding.steps) for finding in compiled_findings(config, test)]


SHOWN = {
    "command": None,
    "entrypoint": None,
    "networks": {"default": None},
    "ipc": "service:sandbox",
    "pids_limit": 512,
    "mem_limit": "1073741824",
    "tmpfs": ["/run:size=2000000000"],
    "ulimits": {"core": {}, "nofile": {"soft": 512, "hard": 1024}},
    "cap_drop": ["NET_RAW"],
    "volumes": [
        {"type": "volume", "source": "tmp", "target": "/tmp", "volume": {}},
        {"type": "bind", "source": "/builds/team/maps", "target": "/maps", "read_only": True},
    ],
    "build": {"context": "/builds/team", "dockerfile": "Dockerfile"},
    "configs": [{"source": "limits", "target": "/limits"}],
}
TMP = {"name": "dodo-t_tmp", "driver_opts": {"type": "tmpfs", "device": "tmpfs", "o": "size=256m,mode=1777"}}


def test_what_compose_shows_of_a_good_test() -> None:
    rest = {
        "networks": {"default": {"name": "dodo-t_default", "ipam": {}, "internal": True}},
        "volumes": {"tmp": TMP},
        "configs": {"limits": {"name": "dodo-t_limits", "file": "/builds/team/limits.json"}},
    }
    assert found(SHOWN, **rest) == []


@pytest.mark.parametrize(
    ("service", "places"),
    [
        ({"privileged": True}, ["services.driver.privileged"]),
        ({"network_mode": "host"}, ["services.driver.network_mode"]),
        ({"network_mode": "bridge"}, ["services.driver.network_mode"]),
        ({"ipc": "host"}, ["services.driver.ipc"]),
        ({"uts": "host"}, ["services.driver.uts"]),
        ({"restart": "always", "container_name": "x"}, ["services.driver.restart", "services.driver.container_name"]),
        ({"logging": {"driver": "syslog"}}, ["services.driver.logging.driver"]),
        ({"devices": [{"source": "/dev/ttyACM0", "target": "/dev/x"}]}, ["services.driver.devices[0].source"]),
        ({"new": 1}, ["services.driver.new"]),
    ],
)
def test_what_is_refused(service: dict[str, Any], places: list[str]) -> None:
    assert found(service) == places


@pytest.mark.parametrize(
    ("options", "refused"),
    [("bind,ro", False), ("rbind,rw,ro", False), ("bind", True), ("bind,ro,rw", True), ("bind, ro", True)],
)
def test_volumes_that_could_be_written_to(options: str, refused: bool) -> None:
    """The engine takes the last word, and none with a space."""
    bound = {"driver_opts": {"type": "none", "o": options, "device": "/usr/share"}}
    assert found({}, volumes={"v": bound}) == ["volumes.v.driver_opts.o"] * refused


@pytest.mark.parametrize(("name", "refused"), [("team", False), ("/", True), ("dodo-other_tmp", True)])
def test_names_of_volumes_that_exist(name: str, refused: bool) -> None:
    places = found({}, volumes={"v": {"name": name, "external": True}})
    assert places == ["volumes.v.name"] * refused


@pytest.mark.parametrize(("word", "refused"), [("writable", True), ("enabled", False), ("readonly", False)])
def test_mounts_below_a_folder(word: str, refused: bool) -> None:
    volume = {"type": "bind", "source": "/builds/team/maps", "target": "/m", "read_only": True}
    places = found({"volumes": [{**volume, "bind": {"recursive": word}}]})
    assert places == ["services.driver.volumes[0].bind.recursive"] * refused


def test_images_of_dodo_are_not_built() -> None:
    places = found({"build": {"context": "/builds/team"}, "image": "dodo/judge:1"})
    assert places == ["services.driver.build", "services.driver.image"]


@pytest.mark.parametrize(
    ("image", "name"),
    [
        ("dodo/judge:1", "dodo/judge"),
        ("docker.io/dodo/judge", "dodo/judge"),
        ("index.docker.io/dodo/judge@sha256:00", "dodo/judge"),
        ("host:5000/dodo/judge:1", "host:5000/dodo/judge"),
        ("host:5000/judge", "host:5000/judge"),
    ],
)
def test_names_of_images(image: str, name: str) -> None:
    assert short_name(image) == name


HARDWARE = {"devices": [{"source": "/dev/ttyACM0"}], "network_mode": "host", "ipc": "host"}


def test_a_rig_s_devices_and_network() -> None:
    assert found(HARDWARE, Access(devices=True), own_network=False) == []
    assert found({"cap_add": ["SYS_RAWIO"]}, Access(devices=True)) == ["services.driver.cap_add[0]"]


def test_privileges_need_a_rig_that_allows_them() -> None:
    service = {"privileged": True, "cap_add": ["SYS_RAWIO"], "security_opt": ["seccomp:unconfined"]}
    assert len(found(service, Access(privileged=True))) == 3
    assert found(service, Access(devices=True, privileged=True)) == []


def test_rigs_do_not_give_disks_or_the_host() -> None:
    every = Access(devices=True, privileged=True)
    assert found({"devices": [{"source": "/dev/sda"}], "pid": "host"}, every) == [
        "services.driver.pid",
        "services.driver.devices[0].source",
    ]


def test_no_rig_gives_its_port() -> None:
    every = Access(devices=True, privileged=True, ports=("/dev/ttyACM0",))
    service = {
        "devices": [{"source": "/dev/video0"}, {"source": "/dev/ttyACM0"}],
        "device_cgroup_rules": ["c 166:* rw"],
        "volumes": [{"type": "bind", "source": "/dev/serial", "target": "/s"}],
    }
    assert found(service, every) == [
        "services.driver.volumes[0].source",
        "services.driver.devices[1].source",
        "services.driver.device_cgroup_rules[0]",
    ]


def test_services_that_the_test_does_not_have() -> None:
    test = CompiledTest([], [], [], True, Access(), HostPaths(FOLDER, (FOLDER,)))
    assert [f.message for f in compiled_findings({"services": {"x": {}}}, test)] == ["the test has no service 'x'"]


def bind(source: str, read_only: bool = True) -> dict[str, Any]:
    return {"type": "bind", "source": source, "target": "/x", "read_only": read_only}


@pytest.mark.parametrize(
    ("volumes", "rest", "places"),
    [
        ([bind("/data", False), bind("/data/sub")], {}, ["services.driver.volumes[1].source"]),
        ([bind("/data", False), bind("/data")], {}, []),
        ([bind("/data"), bind("/data/sub")], {}, []),
        ([bind("/data", False)], {"secrets": {"s": {"file": "/data/s"}}}, ["secrets.s.file"]),
        (
            [{"type": "volume", "source": "v", "target": "/v"}, bind("/data/sub")],
            {"volumes": {"v": {"driver_opts": {"type": "none", "o": "bind", "device": "/data"}}}},
            ["services.driver.volumes[1].source"],
        ),
    ],
)
def test_mounts_within_others_that_variables_have_made(
    volumes: list[Any], rest: dict[str, Any], places: list[str]
) -> None:
    """Nobody knew them when the test was compiled."""
    paths = HostPaths(FOLDER, (FOLDER,), (Path("/data"),), literal=True)
    test = CompiledTest(["driver"], [], [], True, NOTHING, paths)
    service = {"image": "x", "pids_limit": 512, "mem_limit": "1073741824", "cap_drop": ["NET_RAW"], "volumes": volumes}
    findings = compiled_findings({"services": {"driver": service}, **rest}, test)
    assert [shown(finding.steps) for finding in findings if "could put a link" in finding.message] == places
