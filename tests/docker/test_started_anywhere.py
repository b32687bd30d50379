"""Where and how a command is started does not matter on an engine either: the cases in which its paths and users do.

They are for ``make proof``; ``make test`` has an odd path on both backends: test_builds and test_mixed.
"""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import __version__
from tests.drive.test_started_anywhere import OUTSIDE, Case, checkout_of, scratch, started  # noqa: F401

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

ODD = "a$HOME:b#c%20 'ü\""
WITHOUT_COLON = ODD.replace(":", "")
IN_ASCII = Case(
    "subfolder of an odd path in ASCII without HOME, umask 077",
    ODD,
    at="{checkout}/tests",
    umask=0o077,
    environment={"LC_ALL": "C", "PYTHONUTF8": "0", "HOME": None},
)
FROM_OUTSIDE = Case(
    "outside, odd TMPDIR",
    WITHOUT_COLON,
    at="{scratch}",
    words=OUTSIDE,
    report="{checkout}/out",
    environment={"TMPDIR": "{checkout}/tests"},
)
READ_ONLY = Case(
    "read-only checkout in an odd path, umask 077, TMPDIR in memory",
    ODD,
    made="read-only",
    at="{checkout}/tests",
    report="{scratch}/out",
    umask=0o077,
    environment={"TMPDIR": "/dev/shm"},
)


@pytest.mark.proof
@pytest.mark.parametrize(("backend", "case"), [("docker", IN_ASCII), ("docker", FROM_OUTSIDE), ("mixed", READ_ONLY)])
def test_it_passes(backend: str, case: Case, scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """The application is a user whom no file of DoDo's belongs to."""
    config = os.environ.get("DOCKER_CONFIG", str(Path.home() / ".docker"))
    monkeypatch.setenv("DOCKER_CONFIG", config)  # Compose may be there
    service = {
        "image": f"dodo/base:{__version__}",
        "user": "4321:4321",
        "entrypoint": ["python3", "-u", "/app/ahead.py"],
        "ipc": "host",
        "volumes": [".:/app:ro", "/tmp:/tmp"],
    }
    with checkout_of(replace(case, umask=0o022), scratch, **service) as checkout:
        started(case, scratch, checkout, "--backend", backend)
