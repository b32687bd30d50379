"""An engine with files of its own, as in Docker-in-Docker: a test says what the engine does not see."""

import os
import subprocess
import sys

import pytest

from tests.docker.compose import Crate
from tests.run.desk import ROOT

pytestmark = [pytest.mark.engine, pytest.mark.skipif(os.geteuid() != 0, reason="only root mounts")]
MOUNT = 'mount -t tmpfs none "$0"; cp -a "$1" "$0/far"; shift; exec "$@"'


def test_a_test_ends_before_anything_is_pulled(crate: Crate) -> None:
    """What the application mounts is itself on a mount that only DoDo has."""
    folder = crate.bench.folder / "own"
    job = crate.job("far", image="127.0.0.1:9/dodo-no-such-image:1", volumes=[f"{folder}/far:/own:ro"])
    folder.mkdir()
    mounted = ["unshare", "--mount", "--propagation", "private", "sh", "-ec", MOUNT, str(folder), str(job.folder)]
    run = ["-m", "dodo_dsl", "run", "--backend", "docker", "--report", str(job.report), "--compiled", str(job.folder)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*mounted, sys.executable, *run], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 3 and f"does not see '{folder}/far'" in done.stdout, done.stdout + done.stderr
