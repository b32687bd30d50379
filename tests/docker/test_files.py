"""An application of eight services in containers attacks the files that they share, on a real engine."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl import __version__
from tests.run.desk import ROOT

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

TEST = "sil-closed-straight"
SWAPS = {
    "gone": "cd /app && mv data data.old && ln -s /etc data && touch /app/of-attack",
    "turns": "cd /app && while mv data data.old && ln -s /etc data && rm data && mv data.old data; do :; done",
}
LOOK = """
for turn in 1 2 3; do
  echo "sees $(ls /z | tr '\\n' ' ')of $(cat /file)"
  touch /z/of-{0} /to-read/of-{0} /file 2> /dev/null
  sleep 0.3
done
env
"""
PLACES = {"/z": "data", "/to-read": "other"}


def service(script: str, *volumes: str) -> dict[str, object]:
    script = script.replace("$", "$$")
    image = f"dodo/base:{__version__}"
    shown = {"image": image, "user": "0:0", "entrypoint": ["sh", "-c", script], "command": "--cid=111"}
    return {**shown, "volumes": list(volumes), "environment": ["DATABASE_URL"]}


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """One with a shipped test, the application below, and a folder that it wants to lead elsewhere."""
    for name in (TEST, "maps"):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / "tests" / name)
    for name in PLACES.values():
        (tmp_path / name).mkdir()
        (tmp_path / name / "own").write_text("own")
    (tmp_path / "file").write_text("the file")
    services = {f"swaps-{name}": service(f"{script}; sleep 60", ".:/app") for name, script in SWAPS.items()}
    mounts = ["./data:/z", "./other:/to-read:ro", "./file:/file", "./gone:/g", "./gone-too:/h:ro"]
    services |= {f"looks-{number}": service(LOOK.format(number), *mounts) for number in range(6)}
    (tmp_path / "docker-compose.yml").write_text(json.dumps({"services": services}))
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
    return tmp_path


def contents(folder: Path) -> dict[str, str]:
    """The files and folders of a repository, without what DoDo writes."""
    own = (path for path in folder.rglob("*") if path.relative_to(folder).parts[0] not in ("dodo-report", "leases"))
    return {str(path.relative_to(folder)): path.read_text(errors="replace") if path.is_file() else "" for path in own}


@pytest.mark.parametrize("backend", ["docker", pytest.param("mixed", marks=pytest.mark.proof)])
def test_files_stay_where_and_what_they_are(repository: Path, backend: str) -> None:
    """No service sees what another one puts in a folder's place; what they write goes with the test."""
    before = contents(repository)
    environment = {"PYTHONPATH": str(ROOT), "DODO_LEASES": str(repository / "leases"), "DATABASE_URL": "x://a:s3cr3t@b"}
    words = ["run", TEST, "--backend", backend, "-q"]
    subprocess.run(
        [sys.executable, "-m", "dodo_dsl", *words], cwd=repository, env={**os.environ, **environment}, check=False
    )
    (test,) = json.loads((repository / "dodo-report" / "results.json").read_text())["tests"]
    assert test["outcome"] == "failed", test["reason"]
    logs = repository / "dodo-report" / TEST / "logs"
    said = "".join((logs / f"application.looks-{number}.log").read_text() for number in range(6))
    seen = [line for line in said.splitlines() if line.startswith("sees ")]
    assert seen and {line.partition(" of ")[2] for line in seen} == {"the file"}
    assert {word for line in seen for word in line.partition(" of ")[0].split()[1:]} <= {
        "own",
        *(f"of-{number}" for number in range(6)),
    }
    assert "s3cr3t" not in said
    assert contents(repository) == before
