"""An engine as in Docker-in-Docker: reached by a TCP port with TLS, and with files of its own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dodo_dsl.run import capabilities
from tests.docker.compose import Crate
from tests.docker.engine_proxy import EngineProxy, engine_socket
from tests.run.desk import ROOT
from tests.run.docker.engine_stub import make_certificates
from tests.run.faults import FAULTS

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def test_both_sides_of_a_verdict(crate: Crate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if (engine := engine_socket()) is None or not shutil.which("openssl"):
        pytest.skip("there is no engine with a socket here, or no openssl")
    certificates = make_certificates(tmp_path / "certs")
    names = ("neighbour", "killed")
    jobs = [crate.job(name, f.judge, f.application, f.environment) for name in names for f in [FAULTS[name]]]
    with EngineProxy(engine, certificates=certificates) as proxy, monkeypatch.context() as patch:
        for name, value in proxy.variables.items():
            patch.setenv(name, value)
        (found,) = capabilities.docker_engine()
        assert proxy.variables["DOCKER_HOST"] in found.text
        outcomes = crate.run(*jobs)
        assert crate.left() == []
    assert [outcomes[name].outcome for name in names] == ["passed", "failed"], outcomes


MOUNT = 'mount -t tmpfs none "$0"; cp -a "$1" "$0/far"; shift; exec "$@"'


@pytest.mark.skipif(os.geteuid() != 0, reason="only root mounts")
def test_what_the_engine_does_not_see_is_named(crate: Crate) -> None:
    """What the application mounts is itself on a mount that only DoDo has."""
    folder = crate.bench.folder / "own"
    job = crate.job("far", volumes=[f"{folder}/far:/own:ro"])
    folder.mkdir()
    mounted = ["unshare", "--mount", "--propagation", "private", "sh", "-ec", MOUNT, str(folder), str(job.folder)]
    run = ["-m", "dodo_dsl", "run", "--backend", "docker", "--report", str(job.report), "--compiled", str(job.folder)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*mounted, sys.executable, *run], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 3 and f"does not see '{folder}/far'" in done.stdout, done.stdout + done.stderr
