"""Limits and confinement of copied services."""

from typing import Any

import pytest

from dodo_dsl.plan.rewrite.container_limits import confine
from tests.plan.rewrite.copies import CONFINED, copy


@pytest.mark.parametrize(
    ("service", "changed"),
    [
        ({}, CONFINED),
        ({"pids_limit": 10, "mem_limit": "1g"}, {"pids_limit": 10, "mem_limit": "1g"}),
        ({"pids_limit": -1, "mem_limit": "0"}, {}),
        ({"mem_limit": "${M:-0}"}, {}),
        ({"mem_limit": "${M:-8g}"}, {"mem_limit": "${M:-8g}"}),
        ({"mem_limit": "${M}"}, {"mem_limit": "${M}"}),
        ({"cap_drop": ["all"]}, {"cap_drop": ["all"]}),
        (
            {"cap_drop": ["CAP_NET_RAW", "CHOWN"]},
            {"cap_drop": ["CAP_NET_RAW", "CHOWN", "AUDIT_WRITE", "MKNOD", "SETFCAP", "SYS_CHROOT"]},
        ),
        ({"ulimits": {"core": -1, "nofile": 9}}, {"ulimits": {"core": -1, "fsize": 1_000_000_000, "nofile": 9}}),
        ({"security_opt": ["no-new-privileges:false"]}, {"security_opt": ["no-new-privileges:false"]}),
        ({"security_opt": ["${N:-no-new-privileges}"]}, {"security_opt": ["${N:-no-new-privileges}"]}),
        ({"logging": {"driver": "json-file"}}, {"logging": {"driver": "json-file"}}),
        ({"logging": {"driver": "${D:-syslog}"}}, {}),
        ({"labels": {"dodo.test": "x", "team": "a"}}, {"labels": {"team": "a"}}),
        ({"labels": ["com.docker.compose.project=x"]}, {}),
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


def test_on_a_rig_that_allows_privileges_capabilities_stay() -> None:
    own = copy({"privileged": True}, hil=True, privileged=True)
    confine(own)
    assert not {"cap_drop", "security_opt"} & set(own.service)
    assert own.service["pids_limit"] == 1024
