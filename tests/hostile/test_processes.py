"""An application on processes attacks the machine, as root and as an ordinary user."""

import json
import os
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.hostile import attacks
from tests.hostile.command import USERS, told_by
from tests.ordinary_user import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("attacks")]
OF_PLACES = (
    *("repository", "history-of-its-folder", "results", "tests-in-its-folder", "state"),
    *("neighbour", "compiled", "secret", "folder"),
)
NAMES = sorted({*attacks.ATTACKS, *(f"{verb}-{place}" for place in OF_PLACES for verb in ("read", "write"))})


@pytest.fixture(scope="module", params=USERS)
def told(request: pytest.FixtureRequest) -> Iterator[dict[str, Any]]:
    """What became of the attacks of one run."""
    with tempfile.TemporaryDirectory(prefix="dodo-hostile-") as name, socket.socket(socket.AF_UNIX) as listener:
        folder = Path(name)
        secret = Path(tempfile.gettempdir(), f"dodo-test-secret-{os.getpid()}")
        memory = Path("/dev/shm", secret.name)
        for path in (secret, memory):
            path.write_text("of another test")
        listener.bind(f"\0{secret.name}")
        listener.listen()
        of_others = Path(tempfile.mkdtemp(prefix="dodo-test-folder-"))
        (folder / "state").mkdir(mode=0o777)
        (folder / "neighbour").write_text("a recording")
        places = {name: str(folder / name) for name in ("state", "neighbour", "compiled")}
        places |= {"repository": str(ROOT / "tests_registry"), "secret": str(secret), "folder": str(of_others)}
        state = str(folder / "state")
        try:
            yield told_by(
                request.param, "tests.hostile.run_attacks", folder, given=json.dumps(places), XDG_STATE_HOME=state
            )
        finally:
            secret.unlink()
            memory.unlink()
            of_others.rmdir()


def test_the_test_itself_goes_on(told: dict[str, Any]) -> None:
    """The test is judged as if no attack had been tried."""
    assert (told["outcome"], told["reason"]) == ("passed", "it drove")
    assert told["kept"] == ["as it was", "[]"]


@pytest.mark.parametrize("name", NAMES)
def test_it_does_not_get_through(told: dict[str, Any], name: str) -> None:
    """An attack on the machine, its files or other tests does not get through."""
    (row,) = [row for row in told["attacks"] if row["attack"] == name]
    assert not row["through"], row["how"]
