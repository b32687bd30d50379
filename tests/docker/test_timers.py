"""An application in containers that acts by timers, with the test's time: the values of processes."""

import os
import shutil
from pathlib import Path

import pytest
import yaml

from dodo_dsl import __version__
from tests.drive.test_timers import HERE, OUT, drive

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]
HEALTH = ["CMD", "python3", "-c", "import time; time.sleep(0.1)"]
"""A command that keeps the machine's time: nobody lets it go on by the test's."""


def application(folder: Path) -> Path:
    shutil.copy(HERE / "timed.py", folder)
    service = {
        "image": f"dodo/vision:{__version__}",
        "entrypoint": ["python3", "/own/timed.py"],
        "command": "--cid=111 --name=video0.argb",
        "volumes": ["/tmp:/tmp", "./timed.py:/own/timed.py:ro"],
        "healthcheck": {"test": HEALTH, "interval": "1s", "timeout": "20s", "retries": 5},
        "x-dodo": {"in": [], "out": OUT},
        "x-dodo-process": ["python", "timed.py"],
    }
    path = folder / "docker-compose.yml"
    path.write_text(yaml.safe_dump({"services": {"driver": service}}))
    return path


@pytest.mark.parametrize("backend", ["docker", pytest.param("mixed", marks=pytest.mark.proof)])
def test_it_drives_as_with_processes(tmp_path: Path, backend: str) -> None:
    if backend == "mixed" and os.geteuid() != 0:
        pytest.skip("only root enters the network of a container")
    tmp_path.chmod(0o755)
    compose = application(tmp_path)
    tests = [drive(compose, 0, "--backend", each) for each in ("process", backend)]
    assert [test["backend"] for test in tests] == ["process", backend]
    assert {test["outcome"] for test in tests} == {"passed"}, [test["reason"] for test in tests]
    assert tests[0]["checks"] == tests[1]["checks"]
