"""Applications of any content: whatever is read can be rewritten."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from dodo_dsl import source
from dodo_dsl.application.read import read_application
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting

KEYS = {
    "command": st.text(max_size=20) | st.lists(st.text(max_size=8) | st.integers() | st.booleans(), max_size=3),
    "environment": st.dictionaries(st.text(max_size=5), st.none() | st.text(max_size=8) | st.floats(), max_size=3)
    | st.lists(st.sampled_from(["CID", "CID=1", "A=--cid=3", "="]), max_size=3),
    "volumes": st.lists(st.sampled_from(["/tmp:/tmp", "./a:/b:ro", "x", "${A:-b:c}:/d", ":", "tmp:/t", "/dev:/dev"])),
    "networks": st.sampled_from([["a"], {"a": None}, {"a": {"aliases": ["b"]}}, {}, None]),
    "network_mode": st.sampled_from(["host", "none", "service:b", "bridge", "", "container:c"]),
    "depends_on": st.sampled_from([["b"], {"b": {"condition": "service_started"}}, {}, None]),
    "build": st.sampled_from([".", "a", {"context": "x"}, {"dockerfile": "D"}, {}, None]),
    "env_file": st.sampled_from(["~/a", [{"path": "a", "required": False}], [], None]),
    "profiles": st.sampled_from([[], ["p"], None]),
    "deploy": st.sampled_from([{"replicas": 0}, {"mode": "global"}, {}, None]),
    "cap_add": st.lists(st.text(max_size=4), max_size=2),
    "pids_limit": st.sampled_from([-1, 0, 10, "${P:-0}", None]),
    "logging": st.sampled_from([{"driver": "syslog"}, {"driver": "json-file"}, {}, None]),
    "security_opt": st.lists(st.sampled_from(["seccomp:unconfined", "seccomp=./p.json", "x"])),
    "sysctls": st.sampled_from([{"net.a": 1}, ["net.a=1", "b=2"], {}, None]),
    "container_name": st.sampled_from(["c", None]),
    "healthcheck": st.sampled_from([{"test": "x --cid=1"}, {"disable": True}, None]),
    "extends": st.sampled_from(["b", {"service": "b"}]),
    "x-dodo": st.sampled_from([{}, {"in": ["a.B/1"], "done": "a.C", "readers": 2}]),
    "labels": st.dictionaries(st.text(max_size=4), st.text(max_size=4), max_size=2),
    "x-anything": st.recursive(
        st.none() | st.text() | st.integers(), lambda x: st.lists(x) | st.dictionaries(st.text(), x)
    ),
}
IMAGE = {"image": st.text(min_size=1, max_size=8)}
SERVICE = st.fixed_dictionaries(IMAGE, optional=KEYS)
SERVICES = st.fixed_dictionaries({"b": SERVICE}, optional={"a": SERVICE})


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(services=SERVICES, isolation=st.sampled_from(["network", "host"]), hil=st.booleans())
@example(
    services={"b": {"environment": {"X": "1e3", "Y": "0o17", "Z": "08", "N": "null", "D": "2020-01-01"}}},
    isolation="network",
    hil=False,
)
@example(services={"b": {"image": "\x85"}}, isolation="network", hil=False)
@example(services={"b": {"image": "a\u2028b", "command": "x \x85\u2029 y"}}, isolation="network", hil=False)
def test_what_is_read_can_be_rewritten(services: dict[str, Any], isolation: str, hil: bool, tmp_path: Path) -> None:
    """Whatever mapping the reader takes, its copy is YAML of what the Plan has."""
    file = tmp_path / "docker-compose.yml"
    file.write_text(json.dumps({"services": services}))
    found, problems = read_application(file)
    if found is None:
        assert any(p.severity == "error" for p in problems)
        return
    setting = Setting(140, isolation, tmp_path / "generated" / "t", ("track",), hil=hil)
    application = plan_application(found, setting)
    common = ("", "sil", "closed-loop", 10.0, "realtime", isolation, 1, 140, "", "sil", "sandbox", ())
    texts = {f.path: f.text for f in render_plan(Plan("t", "t", "t.dodo.yml", *common, application))}
    node, wrong = source.parse(texts["t/application.compose.yml"], "copy")
    assert node is not None and not wrong
    assert repr(source.plain(node)) == repr(application.compose)
