"""Where and how a command is started does not matter on an engine either: the cases in which its paths and users do."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import __version__
from tests.drive.test_started_anywhere import OUTSIDE, Case, checkout_of, scratch, started  # noqa: F401

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

ODD = "a$HOME:b#c%20 'ü\""
CASES = (
    ("docker", Case("subfolder", at="{checkout}/tests")),
    ("docker", Case("outside", at="{scratch}", words=OUTSIDE, report="checkout/out")),
    ("docker", Case("umask 077", umask=0o077)),
    ("docker", Case("odd path", ODD)),
    ("docker", Case("odd path in ASCII", ODD, environment={"LC_ALL": "C", "PYTHONUTF8": "0"})),
    ("docker", Case("odd TMPDIR", ODD.replace(":", ""), environment={"TMPDIR": "{checkout}/tests"})),
    ("docker", Case("no HOME", environment={"HOME": None})),
    ("mixed", Case("subfolder of a symlink", made="symlink", at="{checkout}/tests")),
    ("mixed", Case("umask 077", umask=0o077)),
    ("mixed", Case("odd path", ODD)),
    ("mixed", Case("TMPDIR in memory", environment={"TMPDIR": "/dev/shm"})),
    ("mixed", Case("read-only checkout", made="read-only", report="{scratch}/out")),
)


@pytest.mark.parametrize(("backend", "case"), CASES, ids=[f"{backend} {case.name}" for backend, case in CASES])
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
