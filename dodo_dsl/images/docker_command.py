"""The docker command: asks it, or lets it show what it does, and says which part of Docker is missing."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from dodo_dsl import advice


class DockerError(Exception):
    usage = False


def _docker() -> str:
    path = shutil.which("docker")
    if path is None:
        raise DockerError(f"the docker command is missing: {advice.DOCKER}")
    return path


def ask(*words: str) -> str:
    """The standard output of a docker command; raises DockerError with the last line of its standard error."""
    result = subprocess.run((_docker(), *words), capture_output=True, text=True, errors="replace", check=False)
    if result.returncode:
        lines = (line.strip() for line in result.stderr.splitlines())
        said = [line for line in lines if line and not line.startswith("Run 'docker ")]
        raise DockerError(said[-1] if said else f"docker {words[0]} ended with {result.returncode}")
    return result.stdout.strip()


def show(*words: str, folder: Path | None = None, variables: Mapping[str, str] | None = None) -> bool:
    """Whether a docker command succeeds, which shows its progress by itself."""
    sys.stdout.flush()
    return subprocess.call((_docker(), *words), cwd=folder, env={**os.environ, **(variables or {})}) == 0
