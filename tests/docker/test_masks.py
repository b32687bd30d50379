"""An application that mounts the whole repository finds no test in it, and nothing of what tests read and wrote."""

import json
import shutil
from pathlib import Path

import pytest

from tests.docker.compose import IMAGE
from tests.drive.applications import dodo
from tests.run.desk import ROOT

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

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
