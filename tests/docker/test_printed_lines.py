"""One application that prints its answers, on three backends: equal values."""

import os
from pathlib import Path

import pytest
import yaml

from dodo_dsl import __version__
from tests.drive.test_printed_answers import Deployment

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def test_three_backends_have_equal_values(tmp_path: Path) -> None:
    """Python holds back lines that it prints into a pipe; in containers it has a terminal, too."""
    tmp_path.chmod(0o755)
    deployment = Deployment(tmp_path)
    deployment.write()
    compose = yaml.safe_load((tmp_path / "docker-compose.yml").read_text())
    compose["services"]["steering"]["image"] = f"dodo/vision:{__version__}"
    (tmp_path / "docker-compose.yml").write_text(yaml.safe_dump(compose))
    backends = ["process", "docker", *(["mixed"] if os.geteuid() == 0 else [])]
    results = [deployment.run("--backend", backend, "--clock", "lockstep") for backend in backends]
    tests = [test for test, _ in results]
    assert [test["backend"] for test in tests] == backends
    assert {test["outcome"] for test in tests} == {"passed"}, [test["reason"] for test in tests]
    assert all((test["checks"], rows) == (tests[0]["checks"], results[0][1]) for test, rows in results)
    log = tmp_path / "dodo-report" / "steer" / "logs" / "application.steering.log"
    assert "group_06;" in log.read_text() and "\r" not in log.read_text()
