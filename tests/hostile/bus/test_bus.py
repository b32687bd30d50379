"""Applications attack their own tests over the bus, in namespaces and on the host, all with one clock in one run."""

import re
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.drive.applications import ROOT, TOLD, dodo, program, results
from tests.drive.variants import registry, variant

BUSY = "the machine was too busy to judge: "
HERE = Path(__file__).parent
FIRST_CID = 128
CAR = ("itself", "opendlv.proxy.", "opendlv.system.", "opendlv.device.")
"""What a car's bus carries."""


STRAIGHT, SIGNAL, PERCEPTION = "sil-closed-straight", "sil-open-straight", "sil-perception--light-1--clutter-0"
REPLAY = "dil-kiwi-track"


class BusAttack(NamedTuple):
    """An attack of ``stranger.py`` in a test that fails by it; ``reason`` is a pattern of the test's."""

    name: str
    test: str
    clock: str
    reason: str
    isolation: str = "network"


def only(message: str, *services: str) -> str:
    """The reason of a test in which the application sent what only services may send."""
    *others, last = [f"'{name}'" for name in services] or ["services of the test"]
    who = f"{', '.join(others)} and {last}" if others else last
    return f"^the application sent {message}, which only {who} may send$"


NAN = "^the application sent opendlv.proxy.GroundSteeringRequest/0 to '.*' after .* s: groundSteering is nan, not a "


def nobody(message: str) -> str:
    return f"^the application sent {message}, which no service of this test sends$"


WALL = "^hit wall "
BOX = "opendlv.logic.perception.DetectionBoundingBox/9"
FRAME, STATE = "opendlv.sim.Frame/0", "opendlv.sim.KinematicState/0"
RUNNER = "^the application sent dodo.TestBegin, which only the runner may send$"

ATTACKS = (
    BusAttack("honest", STRAIGHT, "lockstep", WALL),
    BusAttack("finish", STRAIGHT, "lockstep", only(FRAME, "pose")),
    BusAttack("finish", STRAIGHT, "realtime", only(FRAME, "pose")),
    BusAttack("finish-at-once", STRAIGHT, "lockstep", only(FRAME, "pose")),
    BusAttack("motion", STRAIGHT, "lockstep", only(STATE, "vehicle")),
    BusAttack("reset", STRAIGHT, "lockstep", nobody("opendlv.sim.Command")),
    BusAttack("end", SIGNAL, "lockstep", only("dodo.EndOfInput", "camera", "pose")),
    BusAttack("end", STRAIGHT, "realtime", only("dodo.EndOfInput", "camera", "pose", "vehicle")),
    BusAttack("begin", STRAIGHT, "lockstep", RUNNER),
    BusAttack("begin", STRAIGHT, "realtime", RUNNER),
    BusAttack("seek", REPLAY, "lockstep", ""),
    BusAttack("nan-once", STRAIGHT, "lockstep", NAN),
    BusAttack("nan-once", STRAIGHT, "realtime", NAN),
    BusAttack("unrecorded", STRAIGHT, "lockstep", WALL),
    BusAttack("join", STRAIGHT, "realtime", only(FRAME, "pose")),
    BusAttack("disguise", STRAIGHT, "realtime", WALL),
    BusAttack("channel", STRAIGHT, "lockstep", WALL),
    BusAttack("echo", PERCEPTION, "lockstep", "nothing was detected|no detection|left|recall"),
    BusAttack("boxes", PERCEPTION, "lockstep", only(BOX, "camera")),
    BusAttack("directly", STRAIGHT, "realtime", only(FRAME, "pose")),
    BusAttack("true-pose", STRAIGHT, "lockstep", WALL),
    BusAttack("true-pose", STRAIGHT, "realtime", WALL),
    BusAttack("true-pose", STRAIGHT, "realtime", WALL, "host"),
    BusAttack("easy", SIGNAL, "lockstep", ""),
    BusAttack("channel", STRAIGHT, "lockstep", WALL, "host"),
    BusAttack("join", STRAIGHT, "realtime", only(FRAME, "pose"), "host"),
)


def named(attack: BusAttack) -> str:
    return f"{attack.name}-{attack.test.partition('--')[0]}"


def chosen(clock: str, isolation: str = "network") -> list[BusAttack]:
    """Attacks, by their names."""
    return sorted((each for each in ATTACKS if (each.clock, each.isolation) == (clock, isolation)), key=named)


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
    compose = program(
        folder, "python", "stranger.py", command=f"--attacks={by_bus}", **({"x-dodo": TOLD} if told else {})
    )
    report = folder / "report"
    shutil.copy(HERE / "stranger.py", folder)
    given = ("--application", str(compose), "--report", str(report), "--clock", attacks[0].clock)
    dodo("run", *specs, *given, code=0 if told else (0, 1, 3))
    found = {slug.partition("--")[0]: test for slug, test in results(report).items()}
    for slug in results(report):
        log = (report / slug / "logs" / "application.app.log").read_text()
        found[slug.partition("--")[0]]["heard"] = {line[6:] for line in log.splitlines() if line.startswith("heard ")}
    if isolation == "network" and by_bus.count("=honest") != len(attacks):
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
    assert all(name.startswith(CAR) for name in test["heard"]), test


Found = Callable[[BusAttack], dict[str, Any]]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    """What became of an attack, in one run with all others of its clock."""

    @cache
    def run(clock: str) -> dict[str, dict[str, Any]]:
        return attacked(tmp_path_factory.mktemp(clock), chosen(clock))

    return lambda attack: run(attack.clock)[named(attack)]


@pytest.mark.slow
@pytest.mark.xdist_group("bus-lockstep")
@pytest.mark.parametrize("attack", chosen("lockstep"), ids=named)
def test_it_does_not_get_through(found: Found, attack: BusAttack) -> None:
    """An application that sends what only services may send does not decide its test."""
    check(found(attack), attack)


@pytest.mark.slow
def test_with_its_true_pose_it_would(tmp_path: Path) -> None:
    """So what keeps it from passing is that it is not told; where it declares that, the verdict says so."""
    (attack,) = (each for each in chosen("lockstep") if each.name == "true-pose")
    test = attacked(tmp_path, [attack], told=True)[named(attack)]
    assert test["outcome"] == "passed", test["reason"]
    assert test["reason"].endswith("; the application gets its true pose (opendlv.sim.Frame)")


@pytest.mark.realtime
@pytest.mark.xdist_group("bus-realtime")
@pytest.mark.parametrize("attack", chosen("realtime"), ids=named)
def test_nor_in_real_time(found: Found, attack: BusAttack) -> None:
    """The same in real time, where the attack races what the services send."""
    check(found(attack), attack)


@pytest.mark.parametrize(
    "attack",
    [
        *(pytest.param(each, id=f"{each.name}-steps", marks=pytest.mark.slow) for each in chosen("lockstep", "host")),
        *(pytest.param(each, id=each.name, marks=pytest.mark.realtime) for each in chosen("realtime", "host")),
    ],
)
def test_nor_on_the_host(tmp_path: Path, attack: BusAttack) -> None:
    """The same on the host, with the leases of this user, which keep it apart from other tests there."""
    check(attacked(tmp_path, [attack], "host")[named(attack)], attack)


TESTS = sorted(path.name.partition(".")[0] for path in ROOT.glob("tests_registry/*/*.dodo.yml"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("clock", "names"),
    [
        pytest.param("lockstep", ["dil-static-rig", "sil-open-straight"], id="recording and beacon"),
        pytest.param("lockstep", [n for n in TESTS if n[:3] != "hil"], id="lockstep", marks=pytest.mark.proof),
        pytest.param("realtime", TESTS, id="realtime", marks=[pytest.mark.proof, pytest.mark.realtime]),
    ],
)
def test_an_application_hears_what_a_car_s_bus_carries_alone(clock: str, names: list[str], tmp_path: Path) -> None:
    """In all shipped tests an application hears no truth, no pose and nothing that services send each other."""
    honest = [BusAttack("honest", name, clock, "") for name in names]
    for test in attacked(tmp_path, honest).values():
        assert "itself" in test["heard"] and all(name.startswith(CAR) for name in test["heard"]), test
