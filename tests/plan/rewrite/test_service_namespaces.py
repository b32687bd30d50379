"""Namespaces, networks and dependencies of copied services."""

from typing import Any

import pytest

from dodo_dsl.plan.rewrite.service_namespaces import own_dependencies, own_namespaces
from tests.plan.rewrite.copies import copy

SANDBOX = {"ipc": "service:sandbox"}


@pytest.mark.parametrize(
    ("service", "changed"),
    [
        ({}, SANDBOX),
        ({"network_mode": "host", "ipc": "host"}, SANDBOX),
        ({"network_mode": "none"}, {**SANDBOX, "network_mode": "none"}),
        ({"network_mode": "service:eyes"}, {**SANDBOX, "network_mode": "service:eyes"}),
        ({"network_mode": "container:camera"}, {**SANDBOX, "network_mode": "service:eyes"}),
        ({"network_mode": "service:gone", "pid": "service:eyes"}, {**SANDBOX, "pid": "service:eyes"}),
        ({"networks": ["a", "b"]}, SANDBOX),
        (
            {"networks": {"x": {"aliases": ["n", "m"]}, "y": {"aliases": ["n"]}, "z": None}},
            {**SANDBOX, "networks": {"default": {"aliases": ["n", "m"]}}},
        ),
        ({"network_mode": "none", "networks": {"x": {"aliases": ["n"]}}}, {**SANDBOX, "network_mode": "none"}),
    ],
)
def test_a_network_of_its_own(service: dict[str, Any], changed: dict[str, Any]) -> None:
    own = copy(service)
    own_namespaces(own)
    assert own.service == changed


@pytest.mark.parametrize(
    ("service", "changed"),
    [
        ({}, {"network_mode": "host"}),
        ({"network_mode": "bridge", "links": ["eyes"], "networks": ["a"]}, {"network_mode": "host"}),
        ({"network_mode": "none", "networks": ["a"]}, {"network_mode": "none", "networks": ["a"]}),
        ({"ipc": "host"}, {"ipc": "host", "network_mode": "host"}),
        ({"sysctls": {"net.a": 1, "kernel.b": 2}}, {"sysctls": {"kernel.b": 2}, "network_mode": "host"}),
        ({"sysctls": ["net.a=1"]}, {"network_mode": "host"}),
    ],
)
def test_the_network_of_the_host(service: dict[str, Any], changed: dict[str, Any]) -> None:
    own = copy(service, isolation="host")
    own_namespaces(own)
    assert own.service == changed


STARTED, HEALTHY = {"condition": "service_started"}, {"condition": "service_healthy"}
WAITS = {"sandbox": STARTED, "judge": HEALTHY}


@pytest.mark.parametrize(
    ("service", "changed"),
    [
        ({}, {"depends_on": WAITS}),
        ({"depends_on": ["eyes", "gone"]}, {"depends_on": {"eyes": STARTED, **WAITS}}),
        ({"depends_on": {"eyes": HEALTHY}}, {"depends_on": {"eyes": HEALTHY, **WAITS}}),
        ({"links": ["eyes:e", "gone"]}, {"links": ["eyes:e"], "depends_on": WAITS}),
        (
            {"volumes_from": ["container:camera:ro", "eyes"]},
            {"volumes_from": ["eyes:ro", "eyes"], "depends_on": WAITS},
        ),
    ],
)
def test_dependencies(service: dict[str, Any], changed: dict[str, Any]) -> None:
    own = copy(service)
    own_dependencies(own)
    assert own.service == changed


def test_dependencies_on_the_host() -> None:
    own = copy({}, isolation="host")
    own_dependencies(own)
    assert own.service == {"depends_on": {"judge": HEALTHY}}
