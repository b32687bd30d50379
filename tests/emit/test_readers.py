"""GitLab, the compose specification and compose itself accept the compiled registry."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.plan.plan_json import from_json
from tests.emit.readers import ROOT, check_schema, compose, first_instances, tree

pytestmark = pytest.mark.slow


def test_gitlab_accepts_the_child_pipeline(generated: Path) -> None:
    transform = ("--builtin-schema", "vendor.gitlab-ci", "--data-transform", "gitlab-ci")
    check_schema(*transform, str(generated / "child.gitlab-ci.yml"))


def test_the_compose_specification_accepts_every_layer(generated: Path) -> None:
    layers = [str(layer) for folder in first_instances(generated) for layer in sorted(folder.glob("*.compose.yml"))]
    check_schema("--builtin-schema", "vendor.compose-spec", *layers)


def test_compose_accepts_every_test(generated: Path) -> None:
    for folder in first_instances(generated):
        result = subprocess.run([*compose(), "config", "-q"], cwd=folder, capture_output=True, text=True, check=False)
        assert (result.returncode, result.stderr) == (0, ""), folder.name


def assert_one_project(folder: Path) -> None:
    """Compose sees one project with all services of the test, isolated and with its CID."""
    result = subprocess.run([*compose(), "config", "--format", "json"], cwd=folder, capture_output=True, check=True)
    project = json.loads(result.stdout)
    plan = from_json((folder / "test.json").read_text())
    expected = {"sandbox", *(s.name for s in plan.services), *(s.name for s in plan.application.services)}
    assert project["name"] == f"dodo-{folder.name}"
    assert set(project["services"]) == expected
    for name, service in project["services"].items():
        assert "network_mode" not in service, name
        assert service["ipc"] == ("shareable" if name == "sandbox" else "service:sandbox")
        assert any(f"--cid={plan.cid}" in word for word in service["command"]) or name == "sandbox"


def test_compose_sees_one_project_with_all_services(generated: Path) -> None:
    assert_one_project(generated / "sil-closed-straight")


def test_compose_yaml_lists_what_env_lists(generated: Path, tmp_path: Path) -> None:
    """For who reads it, and for programs that read it instead of ``.env``."""
    folder = tmp_path / "sil-closed-straight"
    shutil.copytree(generated / folder.name, folder)

    def project() -> dict[str, object]:
        words = [*compose(), "config", "--format", "json"]
        found = json.loads(subprocess.run(words, cwd=folder, capture_output=True, check=True).stdout)
        return {key: value for key, value in found.items() if not key.startswith("x-")}

    before = project()
    (folder / ".env").unlink()
    assert project() == before and len(before["services"]) > 8  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["docker-compose.yml", "compose.yaml"])
def test_compose_sees_the_test_whatever_is_above_it(generated: Path, name: str) -> None:
    """Compose looks for a file in all folders above, and takes one before it reads the test's ``.env``."""
    foreign = generated.parent / name
    foreign.write_text("services: {stranger: {image: stranger, network_mode: host}}\n")
    try:
        assert_one_project(generated / "sil-closed-straight")
    finally:
        foreign.unlink()


@pytest.mark.proof
def test_an_installed_wheel_gives_the_same_bytes(generated: Path, tmp_path: Path) -> None:
    wheel, site = tmp_path / "wheel", tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(wheel), str(ROOT)], check=True)
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), *map(str, wheel.glob("*.whl"))], check=True)
    folder = tmp_path / "elsewhere"
    shutil.copytree(generated.parent, folder, ignore=shutil.ignore_patterns("generated"))
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONHASHSEED": "7"}
    where = [sys.executable, "-c", "import dodo_dsl; print(dodo_dsl.__file__)"]
    found = subprocess.run(where, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout
    assert found.startswith(str(site))
    subprocess.run([sys.executable, "-m", "dodo_dsl", "compile"], cwd=folder, env=environment, check=True)
    assert tree(folder / "generated") == tree(generated)
