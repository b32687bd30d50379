"""What a run builds replaces no image of the engine; who mounts the repository finds no test in it."""

import contextlib
import json
import secrets
import shutil
from pathlib import Path

import pytest
import yaml

from dodo_dsl.run.docker.client import connect
from tests.docker.compose import IMAGE, ODD
from tests.drive.applications import dodo, results
from tests.drive.variants import registry, variant
from tests.run.desk import ROOT

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def test_an_image_keeps_what_its_name_stands_for(tmp_path: Path) -> None:
    """In a folder with an odd name."""
    tmp_path /= ODD
    tmp_path.mkdir()
    spec = variant(registry(tmp_path), "sil-closed-straight", "sil-built")
    name = f"dodo-test-{secrets.token_hex(3)}:1"
    (tmp_path / "Dockerfile").write_text(f'FROM {IMAGE}\nENTRYPOINT ["sh", "-c", "echo it is built; sleep 1"]\n')
    compose = tmp_path / "docker-compose.yml"
    compose.write_text(yaml.safe_dump({"services": {"a": {"build": ".", "image": name}, "b": {"image": name}}}))
    with contextlib.closing(connect()) as client:
        before = client.images.get(IMAGE)
        before.tag(*name.split(":"))
        try:
            words = ("--application", str(compose), "--backend", "docker", "--report", str(tmp_path / "report"))
            dodo("run", str(spec), *words, "--retry-errors", "2", code=1)  # the engine may be too busy to start it
            assert client.images.get(name).id == before.id
        finally:
            client.images.remove(name)
    (test,) = results(tmp_path / "report").values()
    assert test["outcome"] == "failed", test
    logs = tmp_path / "report" / "sil-built" / "logs"
    assert {(logs / f"application.{service}.log").read_text() for service in "ab"} == {"it is built\n"}


TEST = "sil-closed-straight"
OWN = ("docker-compose.yml", "dodo.yml", f"{TEST}/README.md")
HIDDEN = (".git/config", "generated/child.gitlab-ci.yml", "dodo-report/old/test.rec", "tests/a/a.json")
LOOK = "exec 2>&1; touch /read/tests/left-behind; find /app /read ! -size 0 -type f"


@pytest.mark.parametrize("backend", ["docker", pytest.param("mixed", marks=pytest.mark.proof)])
def test_what_is_hidden_is_empty(tmp_path: Path, backend: str) -> None:
    """Where the registry holds the application, also in the copy that it may change."""
    for name in (TEST, "maps/straight"):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / name)
    for name in HIDDEN:
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("hidden")
    service = {"image": IMAGE, "entrypoint": ["sh", "-c", LOOK], "command": "--cid=111", "user": "0:0"}
    services = {"looks": {**service, "volumes": [".:/app", "./:/read:ro"]}}
    (tmp_path / "docker-compose.yml").write_text(json.dumps({"services": services}))
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [., tests]\napplication: docker-compose.yml\n")
    words = ("run", TEST, "--backend", backend, "--report", "report", "--retry-errors", "2")
    dodo(*words, code=1, before=("env", "-C", str(tmp_path)))
    refused, *seen = (tmp_path / "report" / TEST / "logs" / "application.looks.log").read_text().splitlines()
    assert refused.endswith("Read-only file system")
    assert set(seen) == {f"/{place}/{name}" for place in ("app", "read") for name in OWN}
    assert not (tmp_path / "tests" / "left-behind").exists()
