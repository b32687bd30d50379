"""Access to the host that is removed from copied services."""

from typing import Any

import pytest

from dodo_dsl.plan.rewrite.confinement import remove_hardware, remove_machine_settings
from tests.plan.rewrite.copies import copy


def test_names_ports_and_policies() -> None:
    own = copy({"image": "x", "container_name": "c", "restart": "always", "ports": ["1:1"], "profiles": []})
    remove_machine_settings(own)
    assert own.service == {"image": "x"}
    assert own.changes == [
        "a: container_name removed, compose names the container",
        "a: ports removed, tests publish none",
        "a: profiles removed, a service with a profile does not start",
        "a: restart removed, containers are not restarted",
    ]


@pytest.mark.parametrize(
    ("service", "changed", "notes"),
    [
        ({"scale": 1}, {}, []),
        ({"scale": 3}, {}, ["a: starts once, not 3 times"]),
        (
            {"scale": 3, "deploy": {"replicas": 2, "resources": {}}},
            {"deploy": {"resources": {}}},
            ["a: starts once, not 2 times", "a: replicas removed from deploy"],
        ),
        ({"deploy": {"mode": "global", "endpoint_mode": "vip"}}, {}, ["a: mode, endpoint_mode removed from deploy"]),
        (
            {"deploy": {"resources": {"reservations": {"memory": "8g", "cpus": "1"}}}},
            {"deploy": {"resources": {"reservations": {"cpus": "1"}}}},
            ["a: memory removed from deploy.resources.reservations"],
        ),
        ({"deploy": {"labels": ["x"]}}, {}, ["a: labels removed from deploy"]),
        (
            {"volumes": [{"type": "volume", "target": "/v", "volume": {"labels": ["x"], "nocopy": True}}]},
            {"volumes": [{"type": "volume", "target": "/v", "volume": {"nocopy": True}}]},
            ["a: labels removed from volumes.*.volume"],
        ),
        (
            {"build": {"context": ".", "labels": ["x"], "tags": ["y"], "x-bake": {}}},
            {"build": {"context": "."}},
            ["a: labels, tags, x-bake removed from build"],
        ),
    ],
)
def test_each_service_runs_once(service: dict[str, Any], changed: dict[str, Any], notes: list[str]) -> None:
    own = copy(service)
    remove_machine_settings(own)
    assert (own.service, own.changes) == (changed, notes)


FULL = {
    "privileged": True,
    "cap_add": ["NET_RAW", "SYS_NICE", "${C:-SYS_ADMIN}"],
    "security_opt": ["seccomp:unconfined", "no-new-privileges:true"],
    "build": {"context": ".", "privileged": True},
    "devices": ["/dev/video0"],
    "volumes": ["/dev/bus:/dev/bus", "./a:/a"],
}
UNPRIVILEGED = {
    "cap_add": ["SYS_NICE"],
    "security_opt": ["no-new-privileges:true"],
    "build": {"context": "."},
}


def test_without_a_rig() -> None:
    own = copy(dict(FULL))
    remove_hardware(own)
    assert own.service == {**UNPRIVILEGED, "volumes": ["./a:/a"]}
    assert own.changes == [
        "a: privileged removed",
        "a: cap_add: removed NET_RAW, ${C:-SYS_ADMIN}",
        "a: security_opt keeps the engine's confinement",
        "a: privileged removed from build",
        "a: devices removed, the test has no hardware",
        "a: volumes: /dev/bus removed, the test has no hardware",
    ]


@pytest.mark.parametrize(
    ("word", "changed", "notes"),
    [
        ("${X}", {}, ["a: cap_add: removed ${X}"]),
        ("${C:-SYS_ADMIN}", {}, ["a: cap_add: removed ${C:-SYS_ADMIN}"]),
        ("SYS_NICE", {"cap_add": "SYS_NICE"}, []),
    ],
)
def test_a_single_word_is_one_item(word: str, changed: dict[str, Any], notes: list[str]) -> None:
    """Compose takes lists alone, which a variable may be mistaken for."""
    own = copy({"cap_add": word})
    remove_hardware(own)
    assert (own.service, own.changes) == (changed, notes)


def test_on_a_rig_devices_stay() -> None:
    own = copy(dict(FULL), hil=True)
    remove_hardware(own)
    assert own.service == {**UNPRIVILEGED, "devices": ["/dev/video0"], "volumes": ["/dev/bus:/dev/bus", "./a:/a"]}


def test_on_a_rig_that_allows_privileges_everything_stays() -> None:
    own = copy(dict(FULL), hil=True, privileged=True)
    remove_hardware(own)
    assert (own.service, own.changes) == (FULL, [])


def test_privileges_need_a_rig() -> None:
    own = copy(dict(FULL), privileged=True)
    remove_hardware(own)
    assert "privileged" not in own.service


def test_privileged_false_is_not_worth_a_note() -> None:
    own = copy({"privileged": False})
    remove_hardware(own)
    assert (own.service, own.changes) == ({}, [])


@pytest.mark.parametrize("privileged", [False, True])
def test_a_rig_s_port_is_removed_on_the_rig_too(privileged: bool) -> None:
    devices = ["/dev/video0:/dev/video0", "/dev/ttyACM0:/dev/tty0", {"source": "/dev/serial/by-id/x", "target": "/x"}]
    rest = {"device_cgroup_rules": ["c 81:* rw", "c *:* rwm"], "volumes": ["/dev:/dev", "${P:-/dev/ttyACM0}:/x"]}
    own = copy({"devices": devices, **rest}, hil=True, privileged=privileged, ports=("/dev/ttyACM0",))
    remove_hardware(own)
    assert own.service == {
        "devices": devices[:1],
        "device_cgroup_rules": ["c 81:* rw"],
        "volumes": ["/dev:/dev"],
    }
    keys = ("devices", "device_cgroup_rules", "volumes")
    assert own.changes == [f"a: {key}: the rig's port removed" for key in keys]
