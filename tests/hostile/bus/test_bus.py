"""An application attacks its own test over the bus, in namespaces and on the host."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.drive.applications import dodo, results
from tests.hostile.bus.table import ATTACKS, STRAIGHT, BusAttack

pytestmark = pytest.mark.slow

BUSY = "the machine was too busy to judge: "
HERE = Path(__file__).parent


def attacked(folder: Path, attack: BusAttack, *words: str) -> dict[str, Any]:
    """The test's result."""
    shutil.copy(HERE / "stranger.py", folder)
    command = f"--cid=111 --name=video0.argb --attack={attack.name}"
    service = {"image": "x", "command": command, "x-dodo-process": ["python", "stranger.py"]}
    compose, report = folder / "docker-compose.yml", folder / "report"
    compose.write_text(yaml.safe_dump({"services": {"stranger": service}}))
    given = ("--application", str(compose), "--report", str(report), "--clock", attack.clock, *words)
    dodo("run", attack.test, *given, code=(1, 3))
    (test,) = results(report).values()
    return test


def check(test: dict[str, Any], attack: BusAttack) -> None:
    """What depends on time may be an error where others keep the machine too busy, which is no pass, either."""
    is_busy = test["reason"].startswith(BUSY) and attack.clock == "realtime"
    assert test["outcome"] == ("error" if is_busy else "failed"), test["reason"]
    reason = test["reason"].partition("; it found: ")[2].rpartition("; run it ")[0] if is_busy else test["reason"]
    assert re.search(attack.reason, reason), test["reason"]


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: f"{attack.name}-{attack.test}-{attack.clock}")
def test_it_does_not_get_through(tmp_path: Path, attack: BusAttack) -> None:
    """An application that sends what only services may send does not decide its test."""
    check(attacked(tmp_path, attack), attack)


@pytest.mark.parametrize("name", ["finish", "spy"])
@pytest.mark.parametrize("clock", ["lockstep", "realtime"])
def test_nor_on_the_host(tmp_path: Path, name: str, clock: str) -> None:
    """The same on the host, with the leases of this user, which keep it apart from other tests there."""
    (attack,) = (each for each in ATTACKS if (each.name, each.test, each.clock) == (name, STRAIGHT, "lockstep"))
    check(attacked(tmp_path, attack._replace(clock=clock), "--isolation", "host"), attack)
