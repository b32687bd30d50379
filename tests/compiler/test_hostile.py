"""Whatever stands in a spec or in an application's compose file, the compiler answers in sentences."""

import shutil
from io import StringIO
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl.cli.main import main

ROOT = Path(__file__).parents[2]
GOOD = yaml.safe_load((ROOT / "tests_registry/sil-closed-straight/sil-closed-straight.dodo.yml").read_text())
KEYS = [
    "command",
    "environment",
    "volumes",
    "env_file",
    "depends_on",
    "build",
    "network_mode",
    "ipc",
    "ports",
    "image",
    "x-dodo",
    "x-dodo-process",
    "entrypoint",
    "networks",
    "container_name",
    "restart",
    "healthcheck",
    "extends",
    "profiles",
]

odd = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 300) | st.floats() | st.text(max_size=6) | st.just("--cid='x"),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=2),
    max_leaves=4,
)
services = st.dictionaries(
    st.sampled_from(["a", "b", "--x", "../y", ""]), odd | st.dictionaries(st.sampled_from(KEYS), odd)
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hostile")
    shutil.copytree(ROOT / "tests_registry" / "maps", path / "maps")
    (path / "t").mkdir()
    (path / "app.yml").write_text("services: {a: {command: --cid=111}}\n")
    return path


def compiled(folder: Path, spec: object, application: str = "app.yml") -> None:
    (folder / "t" / "t.dodo.yml").write_text(yaml.safe_dump(spec))
    stdout, stderr = StringIO(), StringIO()
    words = ["compile", str(folder / "t" / "t.dodo.yml"), "--application", str(folder / application)]
    code = main([*words, "-o", str(folder / "out")], stdout, stderr)
    assert code in (0, 2), stdout.getvalue() + stderr.getvalue()
    assert {p.name for p in folder.iterdir()} <= {"maps", "t", "app.yml", "odd.yml", "out"}


quick = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@quick
@given(services | odd)
def test_odd_applications(folder: Path, application: object) -> None:
    (folder / "odd.yml").write_text(yaml.safe_dump({"services": application}))
    compiled(folder, {**GOOD, "name": "t"}, "odd.yml")


@quick
@given(st.data())
def test_odd_specs(folder: Path, data: st.DataObject) -> None:
    spec = yaml.safe_load(yaml.safe_dump({**GOOD, "name": "t"}))
    node = spec
    while True:
        key = data.draw(st.sampled_from(sorted(node)))
        if isinstance(node[key], dict) and node[key] and data.draw(st.booleans()):
            node = node[key]
        else:
            node[key] = data.draw(odd)
            break
    compiled(folder, spec)
