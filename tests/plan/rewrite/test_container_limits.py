"""Limits and confinement of copied services."""

from typing import Any

import pytest

from dodo_dsl.plan.rewrite.confinement import LOGS, confine
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from tests.plan.rewrite.copies import CONFINED, copy


@pytest.mark.parametrize(
    ("service", "changed"),
    [
        ({}, CONFINED),
        ({"pids_limit": 10, "mem_limit": "1g"}, {"pids_limit": 10, "mem_limit": "1g"}),
        ({"pids_limit": -1, "mem_limit": "0"}, {}),
        ({"mem_limit": "${M:-0}"}, {}),
        ({"mem_limit": "${M:-8g}"}, {}),
        ({"mem_limit": "${M:-1g}"}, {"mem_limit": "${M:-1g}"}),
        ({"mem_limit": "${M}"}, {"mem_limit": "${M}"}),
        ({"pids_limit": 70000, "mem_limit": "1t"}, {}),
        ({"memswap_limit": -1, "shm_size": "64g"}, {"memswap_limit": 4_000_000_000, "shm_size": 2_000_000_000}),
        ({"memswap_limit": "3gb", "shm_size": "64m"}, {"memswap_limit": "3gb", "shm_size": "64m"}),
        ({"cpu_shares": 262144, "cpus": 64}, {"cpu_shares": 1024, "cpus": 64}),
        ({"tmpfs": "/run"}, {"tmpfs": "/run:size=2000000000"}),
        (
            {"tmpfs": ["/run:size=90%,mode=755", "/x:size=64m", "/y:nr_blocks=9", "${T}:size=1m", "/z:${T}"]},
            {
                "tmpfs": [
                    "/run:mode=755,size=2000000000",
                    "/x:size=64m",
                    "/y:size=2000000000",
                    "${T}:size=1m",
                    "/z:${T}",
                ]
            },
        ),
        (
            {
                "volumes": [
                    {"type": "tmpfs", "target": "/x"},
                    {"type": "tmpfs", "target": "/y", "tmpfs": {"size": "9g"}},
                ]
            },
            {
                "volumes": [
                    {"type": "tmpfs", "target": "/x", "tmpfs": {"size": 2_000_000_000}},
                    {"type": "tmpfs", "target": "/y", "tmpfs": {"size": 2_000_000_000}},
                ]
            },
        ),
        ({"cap_drop": ["all"]}, {"cap_drop": ["all"]}),
        (
            {"cap_drop": ["CAP_NET_RAW", "CHOWN"]},
            {"cap_drop": ["CAP_NET_RAW", "CHOWN", "AUDIT_WRITE", "MKNOD", "SETFCAP", "SYS_CHROOT"]},
        ),
        ({"ulimits": {"core": -1, "nofile": 9}}, {"ulimits": {**CONFINED["ulimits"], "nofile": 9}}),
        ({"ulimits": {"nproc": 40}}, {}),
        (
            {"ulimits": {"nofile": {"soft": 512, "hard": 99999}, "memlock": -1, "rtprio": 99}},
            {
                "ulimits": {
                    **CONFINED["ulimits"],
                    "nofile": {"soft": 512, "hard": 1024},
                    "memlock": 2_000_000_000,
                    "rtprio": 99,
                }
            },
        ),
        (
            {"build": {"context": ".", "shm_size": "9g", "ulimits": {"nproc": 9999}}},
            {"build": {"context": ".", "shm_size": 2_000_000_000, "ulimits": {"nproc": 1024}}},
        ),
        ({"security_opt": ["no-new-privileges:false"]}, {"security_opt": ["no-new-privileges:false"]}),
        ({"security_opt": ["${N:-no-new-privileges}"]}, {"security_opt": ["${N:-no-new-privileges}"]}),
        ({"logging": {"driver": "local"}}, {"logging": {"driver": "local", "options": LOGS}}),
        ({"logging": {"options": {"tag": "x"}}}, {"logging": {"driver": "json-file", "options": {"tag": "x", **LOGS}}}),
        ({"logging": {"driver": "json-file", "options": {"max-size": "-1"}}}, {}),
        ({"logging": None}, {}),
        ({"logging": {"options": {"max-size": "1m"}}}, {"logging": {"options": {"max-size": "1m"}}}),
        ({"logging": {"driver": "${D:-syslog}"}}, {}),
    ],
)
def test_what_a_service_gets(service: dict[str, Any], changed: dict[str, Any]) -> None:
    own = copy(service)
    confine(own)
    assert own.service == {**CONFINED, **changed}


def test_limits_below_deploy_are_limits() -> None:
    own = copy({"deploy": {"resources": {"limits": {"memory": "1g", "pids": 0}}}})
    confine(own)
    assert own.service["deploy"] == {"resources": {"limits": {"memory": "1g", "pids": 1024}}}
    assert not {"pids_limit", "mem_limit"} & set(own.service)


def test_limits_go_where_others_are() -> None:
    own = copy({"deploy": {"resources": {"limits": {"cpus": "2"}}}, "mem_limit": 0})
    confine(own)
    assert own.service["deploy"]["resources"]["limits"] == {"cpus": "2", "pids": 1024, "memory": "2000000000"}
    assert not {"pids_limit", "mem_limit"} & set(own.service)


def test_limits_below_deploy_are_cut_there() -> None:
    own = copy({"deploy": {"resources": {"limits": {"memory": "1t", "pids": 9999, "cpus": "64"}}}})
    confine(own)
    assert own.service["deploy"]["resources"]["limits"] == {"memory": "2000000000", "pids": 1024, "cpus": "64"}
    assert "a: deploy.resources.limits.memory is 2000000000" in own.changes


@pytest.mark.parametrize(
    ("service", "key", "cut"),
    [
        ({}, "cpus", 2.5),
        ({"cpus": "1.5"}, "cpus", "1.5"),
        ({"cpus": 3}, "cpus", 2.5),
        ({"cpus": 0}, "cpus", 2.5),
        ({"cpu_quota": 400_000}, "cpu_quota", 250_000),
        ({"cpu_quota": 100_000, "cpu_period": 50_000}, "cpu_quota", 100_000),
        ({"cpu_quota": -1, "cpu_period": 10_000}, "cpu_quota", 25_000),
        ({"deploy": {"resources": {"limits": {}}}}, "deploy", "2.5"),
    ],
)
def test_processors_where_dodo_yml_limits_them(service: dict[str, Any], key: str, cut: object) -> None:
    own = copy(service, limits=SandboxLimits(cpus=2.5))
    confine(own)
    found = own.service[key]
    assert (found["resources"]["limits"]["cpus"] if key == "deploy" else found) == cut
    assert ("cpus" in own.service) == (key == "cpus")


def test_on_a_rig_that_allows_privileges_capabilities_stay() -> None:
    own = copy({"privileged": True}, hil=True, privileged=True)
    confine(own)
    assert not {"cap_drop", "security_opt"} & set(own.service)
    assert own.service["pids_limit"] == 1024
