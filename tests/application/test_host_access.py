"""Mounts and references of services: hardware, the host, and other services."""

from typing import Any

import pytest

from dodo_dsl.application import host_access
from dodo_dsl.application.host_access import Mount


@pytest.mark.parametrize(
    ("volume", "expected"),
    [
        ("/a:/b", Mount("/a", "/b")),
        ("/a/:/b//c:ro", Mount("/a", "/b/c", read_only=True)),
        ("/a:/b:ro,rw", Mount("/a", "/b")),
        ({"source": "/a", "target": "/b", "read_only": "True"}, Mount("/a", "/b", read_only=True)),
        ("name:/b:z,ro", Mount("name", "/b", read_only=True)),
        ("/b", Mount("", "/b")),
        ("${A:-/x:y}:/b", Mount("${A:-/x:y}", "/b")),
        ({"type": "bind", "source": "/a", "target": "/b", "read_only": True}, Mount("/a", "/b", read_only=True)),
        ({"type": "tmpfs", "target": "/b"}, Mount("", "/b")),
    ],
)
def test_mounts(volume: object, expected: Mount) -> None:
    assert host_access.mount(volume) == expected


@pytest.mark.parametrize(
    ("source", "hardware", "machine", "memory"),
    [
        ("/dev/ttyUSB0", True, False, False),
        ("/dev", True, False, False),
        ("/dev/null", False, False, False),
        ("/dev/shm/x", False, False, True),
        ("/sys/class/gpio", True, False, False),
        ("/device", False, False, False),
        ("/run/user/1000/pulse/native", True, False, False),
        ("/run/user/1000/bus", False, False, False),
        ("/", False, True, False),
        ("/proc/1", False, True, False),
        ("/var/run/docker.sock", False, True, False),
        ("/run/user/1000/podman/podman.sock", False, True, False),
        ("/tmp", False, False, False),
        ("/tmp/.X11-unix", True, False, False),
        ("~/.Xauthority", True, False, False),
    ],
)
def test_what_a_mount_gives_access_to(source: str, hardware: bool, machine: bool, memory: bool) -> None:
    found = Mount(source, "/x")
    assert host_access.is_hardware(found) is hardware
    assert host_access.is_machine(found) is machine
    assert host_access.is_shared_memory(found) is memory


@pytest.mark.parametrize(
    ("volume", "expected"),
    [
        ("maps:/maps", "maps"),
        ("a/b:/maps:ro", "a/b"),
        ("/maps", ""),
        ("./maps:/maps", ""),
        ("$MAPS:/maps", ""),
        ("maps-${CAR}:/maps", ""),
        ("d:/maps", ""),
        ("\\\\server\\maps:/maps", ""),
        ({"type": "volume", "source": "maps"}, "maps"),
        ({"type": "volume"}, ""),
        ({"type": "bind", "source": "maps"}, ""),
    ],
)
def test_named_volumes(volume: Any, expected: str) -> None:
    assert host_access.named_volume(volume) == expected


def test_reading_is_harmless() -> None:
    assert not host_access.is_hardware(Mount("/sys/class", "/x", read_only=True))


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("service:a", ("service", "a")),
        ("container:b", ("container", "b")),
        ("host", ("", "")),
        ("other:a", ("", "")),
        (None, ("", "")),
    ],
)
def test_references_to_namespaces(value: object, expected: tuple[str, str]) -> None:
    assert host_access.reference(value) == expected


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("a", ("service", "a", "")),
        ("a:ro", ("service", "a", ":ro")),
        ("container:b:ro", ("container", "b", ":ro")),
        ("service:a", ("service", "a", "")),
    ],
)
def test_borrowed_volumes(entry: str, expected: tuple[str, str, str]) -> None:
    assert host_access.borrowed(entry) == expected


@pytest.mark.parametrize(
    "device",
    [
        "/dev/mem",
        "/dev/sda",
        "/dev/sda1:/dev/x",
        "/dev//nvme0n1p1",
        "/dev/../dev/loop0",
        "/dev/mapper",
        "/dev/block/8:0",
    ],
)
def test_devices_of_the_machine(device: str) -> None:
    assert host_access.is_of_machine(device)


@pytest.mark.parametrize(
    "device", ["/dev/ttyACM0", "/dev/video0:/dev/x", "/dev/sensors", "/dev/null", "", "/dev/ramen/x"]
)
def test_devices_of_robots(device: str) -> None:
    assert not host_access.is_of_machine(device)


def test_services_that_a_service_needs() -> None:
    service = {
        "network_mode": "service:a",
        "ipc": "container:eyes",
        "pid": "container:stranger",
        "volumes_from": ["c:ro", "container:eyes", "container:stranger"],
        "links": ["d:alias"],
        "depends_on": {"e": {"condition": "service_started"}, "f": {"required": False}},
    }
    assert list(host_access.references(service, {"eyes": "b"})) == [
        ("network_mode", "a"),
        ("ipc", "b"),
        ("volumes_from", "c"),
        ("volumes_from", "b"),
        ("links", "d"),
        ("depends_on", "e"),
    ]


def test_words() -> None:
    assert not host_access.is_harmless_capability("cap_sys_admin")
    assert host_access.is_harmless_capability("cap_sys_nice")
    assert [host_access.is_confining(o) for o in ("no-new-privileges:true", "no-new-privileges=1", "label:x")] == [
        True,
        True,
        False,
    ]
    assert [host_access.is_external(v) for v in ({"external": True}, {"external": {"name": "x"}}, {}, None)] == [
        True,
        True,
        False,
        False,
    ]
    assert [host_access.is_true(v) for v in (True, "true", "${P}", False, "false", "", None)] == [True] * 3 + [
        False
    ] * 4
