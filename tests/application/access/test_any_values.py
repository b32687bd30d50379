"""Whatever stands in a compose file: it is judged, and nothing breaks."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl.application.access import compose_keys
from dodo_dsl.application.access.findings import CompiledTest, compiled_findings
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import Access, Rows
from dodo_dsl.application.read import read_application
from dodo_dsl.diagnostics import format_text
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting

WORDS = st.sampled_from(["", "host", "/", "..", "$", "${A", "${A:-/}", "bind", "a:b:c", "x=y", "ALL", "~", "~nobody/x"])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | WORDS | st.text(max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS | st.text(max_size=4), inner, max_size=3),
    max_leaves=8,
)


def some(rows: Rows) -> st.SearchStrategy[dict[str, Any]]:
    """Some of the keys, with any values."""
    return st.dictionaries(st.sampled_from(sorted(rows)), VALUES, max_size=6)


SERVICE = st.builds(
    lambda service, build, mounts: {**service, **build, **mounts},
    some(compose_keys.SERVICE),
    st.just({}) | st.builds(lambda build: {"build": build}, some(compose_keys.BUILD)),
    st.just({}) | st.builds(lambda mounts: {"volumes": mounts}, st.lists(some(compose_keys.MOUNT), max_size=2)),
)
SHARED = st.fixed_dictionaries(
    {},
    optional={
        key: st.dictionaries(st.sampled_from(["a", "b"]), some(rows) | VALUES, max_size=2)
        for key, rows in (
            ("volumes", compose_keys.VOLUME),
            ("secrets", compose_keys.SECRET),
            ("configs", compose_keys.CONFIG),
            ("networks", compose_keys.NETWORK),
        )
    },
)


@pytest.mark.slow
@given(service=SERVICE, rest=SHARED)
def test_compiled_files(service: dict[str, Any], rest: dict[str, Any]) -> None:
    paths = HostPaths(Path("/builds/team"), (Path("/builds/team"),))
    test = CompiledTest(["a"], [], ["dodo/a"], True, Access(), paths)
    for finding in compiled_findings({"services": {"a": service}, **rest}, test):
        assert finding.message


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(service=SERVICE, rest=SHARED)
def test_written_files(service: dict[str, Any], rest: dict[str, Any], tmp_path: Path) -> None:
    """What the reader takes can be rewritten, too."""
    file = tmp_path / "docker-compose.yml"
    file.write_text(json.dumps({"services": {"a": {**service, "image": "x"}}, **rest}))
    source, problems = read_application(file)
    assert format_text(problems) or source is not None
    if source is not None:
        setting = Setting(140, "network", tmp_path / "t")
        assert plan_application(source, setting).compose["services"]["a"]
