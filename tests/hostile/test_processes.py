"""An application on processes attacks the machine, as root and as an ordinary user."""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.hostile import attacks
from tests.ordinary_user import words_as_user
from tests.run.desk import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("attacks")]
OF_PLACES = (
    "repository",
    "history-of-its-folder",
    "results",
    "tests-in-its-folder",
    "state",
    "neighbour",
    "compiled",
    "secret",
    "folder",
)
NAMES = sorted({*attacks.ATTACKS, *(f"{verb}-{place}" for place in OF_PLACES for verb in ("read", "write"))})


@pytest.fixture(scope="module", params=["root", "user"])
def told(request: pytest.FixtureRequest) -> Iterator[dict[str, Any]]:
    """What became of the attacks of one run."""
    if request.param == "root" and os.getuid() != 0:
        pytest.skip("only root can try it as root")
    with tempfile.TemporaryDirectory(prefix="dodo-hostile-") as name, socket.socket(socket.AF_UNIX) as listener:
        folder = Path(name)
        secret = Path(tempfile.gettempdir(), f"dodo-test-secret-{os.getpid()}")
        secret.write_text("of another test")
        listener.bind(f"\0{secret.name}")
        listener.listen()
        memory = Path("/dev/shm", secret.name)
        memory.write_text("of another test")
        of_others = Path(tempfile.mkdtemp(prefix="dodo-test-folder-"))
        (folder / "state").mkdir(mode=0o777)
        (folder / "neighbour").write_text("a recording")
        places = {
            "repository": str(ROOT / "tests_registry"),
            "state": str(folder / "state"),
            "neighbour": str(folder / "neighbour"),
            "compiled": str(folder / "compiled"),
            "secret": str(secret),
            "folder": str(of_others),
        }
        as_user = words_as_user(folder) if request.param == "user" and os.getuid() == 0 else []
        words = [*as_user, sys.executable, "-m", "tests.hostile.run_attacks", name]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder / "state"), "HOME": name}
        done = subprocess.run(
            words, input=json.dumps(places), capture_output=True, text=True, check=False, cwd=ROOT, env=environment
        )
        secret.unlink()
        of_others.rmdir()
        memory.unlink()
        assert done.returncode == 0, done.stdout + done.stderr
        yield json.loads(done.stdout.splitlines()[-1])
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()


def test_the_test_itself_goes_on(told: dict[str, Any]) -> None:
    """The test is judged as if no attack had been tried."""
    assert (told["outcome"], told["reason"]) == ("passed", "it drove")
    assert told["kept"] == ["as it was", "[]"]


@pytest.mark.parametrize("name", NAMES)
def test_it_does_not_get_through(told: dict[str, Any], name: str) -> None:
    """An attack on the machine, its files or other tests does not get through."""
    (row,) = [row for row in told["attacks"] if row["attack"] == name]
    assert not row["through"], row["how"]
