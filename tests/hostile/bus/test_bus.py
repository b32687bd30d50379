"""Applications attack their own tests over the bus, in namespaces and on the host, all with one clock in one run."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.drive import heard
from tests.drive.applications import TOLD, dodo, results
from tests.drive.variants import registry, variant
from tests.hostile.bus.table import ATTACKS, STRAIGHT, BusAttack

BUSY = "the machine was too busy to judge: "
HERE = Path(__file__).parent
FIRST_CID = 128


def named(attack: BusAttack) -> str:
    return f"{attack.name}-{attack.test.partition('--')[0]}"


def chosen(clock: str, isolation: str) -> list[BusAttack]:
    return sorted((each for each in ATTACKS if (each.clock, each.isolation) == (clock, isolation)), key=named)


LOCKSTEP, REALTIME = (chosen(clock, "network") for clock in ("lockstep", "realtime"))
ON_THE_HOST = [
    pytest.param(each, id=f"{each.name}-{each.clock}", marks=getattr(pytest.mark, mark))
    for clock, mark in (("lockstep", "slow"), ("realtime", "realtime"))
    for each in chosen(clock, "host")
]


def attacked(
    folder: Path, attacks: list[BusAttack], isolation: str = "network", told: bool = False
) -> dict[str, dict[str, Any]]:
    """The results of attacks, in one run: the application knows by its bus which is its own.

    ``told``: it declares to take the true pose, which the tests then do not hide.
    On the host other tests may have leased the first buses, so there one attack runs at a time.
    """
    tests = registry(folder)
    pose = {"pose": "declared"} if told else {}
    specs = [str(variant(tests, each.test, named(each), isolation=isolation, **pose)) for each in attacks]
    by_bus = ",".join(f"{cid}={each.name}" for cid, each in enumerate(attacks, FIRST_CID))
    command = f"--cid=111 --name=video0.argb --attacks={by_bus}"
    service = {"image": "x", "command": command, "x-dodo-process": ["python", "stranger.py"]}
    service |= {"x-dodo": TOLD} if told else {}
    compose, report = folder / "docker-compose.yml", folder / "report"
    compose.write_text(yaml.safe_dump({"services": {"stranger": service}}))
    shutil.copy(HERE / "stranger.py", folder)
    given = ("--application", str(compose), "--report", str(report), "--clock", attacks[0].clock)
    dodo("run", *specs, *given, code=0 if told else (1, 3))
    found = {slug.partition("--")[0]: test for slug, test in results(report).items()}
    for slug in results(report):
        log = (report / slug / "logs" / "application.stranger.log").read_text()
        found[slug.partition("--")[0]]["heard"] = {line[6:] for line in log.splitlines() if line.startswith("heard ")}
    if isolation == "network":
        assert {name: test["cid"] for name, test in found.items()} == {
            named(each): cid for cid, each in enumerate(attacks, FIRST_CID)
        }
    return found


def check(test: dict[str, Any], attack: BusAttack) -> None:
    """What depends on time may be an error where others keep the machine too busy, which is no pass, either."""
    is_busy = test["reason"].startswith(BUSY) and attack.clock == "realtime"
    assert test["outcome"] == ("error" if is_busy else "failed"), test["reason"]
    reason = test["reason"].partition("; it found: ")[2].rpartition("; run it ")[0] if is_busy else test["reason"]
    assert re.search(attack.reason, reason), test["reason"]
    assert heard.strangers({attack.name: test["heard"]}) == {}, "the application hears the world"


@pytest.fixture(scope="module")
def lockstep(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    return attacked(tmp_path_factory.mktemp("lockstep"), LOCKSTEP)


@pytest.fixture(scope="module")
def realtime(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    return attacked(tmp_path_factory.mktemp("realtime"), REALTIME)


@pytest.mark.slow
@pytest.mark.xdist_group("bus-lockstep")
@pytest.mark.parametrize("attack", LOCKSTEP, ids=named)
def test_it_does_not_get_through(lockstep: dict[str, dict[str, Any]], attack: BusAttack) -> None:
    """An application that sends what only services may send does not decide its test."""
    check(lockstep[named(attack)], attack)


@pytest.mark.slow
def test_with_its_true_pose_it_would(tmp_path: Path) -> None:
    """So what keeps it from passing is that it is not told; where it declares that, the verdict says so."""
    (attack,) = (each for each in LOCKSTEP if (each.name, each.test) == ("true-pose", STRAIGHT))
    test = attacked(tmp_path, [attack], told=True)[named(attack)]
    assert test["outcome"] == "passed", test["reason"]
    assert test["reason"].endswith("; the application is told its true pose (opendlv.sim.Frame)")


@pytest.mark.realtime
@pytest.mark.xdist_group("bus-realtime")
@pytest.mark.parametrize("attack", REALTIME, ids=named)
def test_nor_in_real_time(realtime: dict[str, dict[str, Any]], attack: BusAttack) -> None:
    """The same in real time, where the attack races what the services send."""
    check(realtime[named(attack)], attack)


@pytest.mark.parametrize("attack", ON_THE_HOST)
def test_nor_on_the_host(tmp_path: Path, attack: BusAttack) -> None:
    """The same on the host, with the leases of this user, which keep it apart from other tests there."""
    check(attacked(tmp_path, [attack], "host")[named(attack)], attack)
