"""The targets of the bake file, as bake reads them without an engine."""

import functools
import json
import shutil
import subprocess
from typing import Any

import pytest

from dodo_dsl.images.build_context import BAKE
from tests.images.conftest import ROOT


@functools.cache
def targets() -> dict[str, dict[str, Any]]:
    """What is built, by the image's name."""
    asked = ["docker", "buildx", "version"]
    if not shutil.which("docker") or subprocess.run(asked, capture_output=True, check=False).returncode:
        pytest.skip("docker or its buildx is not installed (scripts/install-test-tools)")
    words = ["docker", "buildx", "bake", "--file", BAKE, "--print", "default", "dodo"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, Any]] = json.loads(done.stdout)["target"]
    return found


def folders_of(image: str) -> set[str]:
    """What the image of a service holds of ``services``, beside what all share: its own folder, and often the scene."""
    arguments = targets()[image]["args"]
    return {arguments["FOLDER"], *(["scene"] if arguments["STAGE"] in ("pictures", "vision") else [])}
