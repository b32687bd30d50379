"""``dodo`` as a function, and programs that attack as root or as an ordinary user."""

import json
import os
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli.main import main
from tests.ordinary_user import ROOT, words_as_user

STRANGER = 54_321
"""The number of a user who owns nothing on this machine."""
USERS = ("root", "user")


def dodo(*words: str) -> tuple[int, str]:
    """Its exit code, and all that it would print."""
    stdout = StringIO()
    code = main(words, stdout, stdout)
    return code, stdout.getvalue()


def told_by(user: str, module: str, folder: Path, *words: str, given: str = "", **variables: str) -> dict[str, Any]:
    """What a program of the tests prints as JSON at its end, one of ``USERS`` with ``folder`` as home."""
    if user == "root" and os.getuid() != 0:
        pytest.skip("only root can try it as root")
    as_user = words_as_user(folder) if user == "user" and os.getuid() == 0 else []
    command = [*as_user, sys.executable, "-m", module, str(folder), *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "HOME": str(folder), **variables}
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=False, cwd=ROOT, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return told
