"""Rigs that a repository, a job or a number would move unasked."""

import json
import os
import pwd
import time
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.assets.car import read_car
from dodo_dsl.opendlv.assets.trajectory import read_points
from dodo_dsl.opendlv.assets.trajectory import read_table as read_points_table
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.run import leases
from dodo_dsl.run.rigs import leases as rigs_leases
from dodo_dsl.run.rigs import permission
from dodo_dsl.run.rigs.leases import device_key, device_leases, identity
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec import machine as operator
from dodo_dsl.spec.machine import MachineError, machine
from services.base.flags import parse
from services.continuous_signal.target import read_table
from services.gantry import manual
from services.gantry.protocol import answer
from tests.hostile.command import dodo
from tests.run.helpers import Bench
from tests.run.rigs.place import Place, place

__all__ = ["place"]
NUMBERS = ("1_0", "1e1_0", "١", "１", "0x10", "1 0", "ten", "1-", "1,5", "nan", "inf", "1e999", "²")
"""Python's ``float`` or ``int`` takes some of these; no person writes them."""


def goto(text: str) -> str:
    code, output = dodo("rig", "goto", "emulated", text, "0", "0")
    assert code == 2
    return output


def the_rig_s_program(text: str) -> str:
    output = StringIO()
    assert manual.main(["--serial=/dev/null", "goto", "0", text, "0"], output) == 2
    return output.getvalue()


def refused(read: Callable[[], object]) -> str:
    with pytest.raises(ValueError) as caught:
        read()
    return str(caught.value)


def table(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


PLACES: dict[str, Callable[[str, Path], str]] = {
    "dodo rig goto": lambda text, _: goto(text),
    "dodo rig --wait": lambda text, _: dodo("rig", "home", "emulated", "--wait", text)[1],
    "the rig's program": lambda text, _: the_rig_s_program(text),
    "flags": lambda text, _: refused(lambda: parse({"parameters": {"a": {"type": "number"}}}, [f"--a={text}"])),
    "a target": lambda text, path: refused(lambda: read_table(table(path, f"time,x\n0,1\n1,{text}\n"), "x", False)),
    "a time": lambda text, path: refused(lambda: read_table(table(path, f"time,x\n0,1\n{text},1\n"), "x", False)),
    "way points": lambda text, path: refused(lambda: read_points_table(table(path, f"x,y\n0,{text}\n"), 0.0)),
    "a way point": lambda text, _: refused(lambda: read_points([f"0 {text}"], 0.0)),
    "a car": lambda text, path: refused(lambda: read_car(table(path, f"mass: {text}\n"))),
    "dodo rec": lambda text, _: dodo("rec", "cut", "a.rec", "-o", "b.rec", "--start", text)[1],
    "dodo rec --camera": lambda text, _: dodo("rec", "export", "a.rec", "--coco", "--camera", text)[1],
    "dodo run --seed": lambda text, _: dodo("run", "--seed", text)[1],
    "dodo run -j": lambda text, _: dodo("run", "-j", text)[1],
    "dodo run --wall-timeout": lambda text, _: dodo("run", "--wall-timeout", text)[1],
}


@pytest.mark.thorough
@pytest.mark.parametrize("text", NUMBERS)
@pytest.mark.parametrize("where", PLACES)
def test_numbers_that_only_python_reads(
    where: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numbers that only Python would read, such as 1_0, are refused."""
    monkeypatch.chdir(tmp_path)
    said = PLACES[where](text, tmp_path / "table") + capsys.readouterr().err
    assert "not" in said or "takes 3 numbers" in said or "expected" in said, said
    assert "there is no" not in said and "No such file" not in said, "it was read as a number"


@pytest.mark.parametrize("text", NUMBERS)
def test_the_serial_line_has_no_such_numbers(text: str) -> None:
    """The gantry's serial line takes no such numbers either."""
    assert answer(f"$0.1,{text},0.2") is None
    assert answer(f"${text}") is None


# Devices


def test_all_names_of_a_device_are_one(tmp_path: Path) -> None:
    (tmp_path / "rig").symlink_to("/dev/null")
    (tmp_path / "again").symlink_to(tmp_path / "rig")
    names = ["/dev/null", "/dev/../dev/null", str(tmp_path / "rig"), str(tmp_path / "again")]
    assert {identity(name) for name in names} == {"path /dev/null"}
    assert len({device_key(name) for name in names}) == len(device_leases([*names, __file__, "emulated"])) == 1
    assert {identity(f"socket://{host}:4242") for host in ("127.0.0.1", "localhost", "[::1]")} == {"socket 4242"}
    assert device_leases(["socket://127.0.0.1:4242"]) == device_leases(["socket://localhost:4242"]) != []


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository whose rig is a device that no program moves."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    answers = {"says": "the rig is idle", "x": None}
    monkeypatch.setattr("dodo_dsl.cli.rig.query_exclusively", lambda *_: answers)  # what is behind permission
    return tmp_path


def rig(folder: Path, name: str = "fake", port: str = "/dev/null") -> None:
    about = {"kind": "dynamic", "cid": 121, "serial": port}
    (folder / "dodo.yml").write_text(json.dumps({"dodo": 1, "rigs": {name: about}}))


def test_a_rig_with_another_name_stays_in_quarantine(repository: Path) -> None:
    rigs_leases.quarantine("fake", "it has lost steps", ["/dev/null"])
    (repository / "link").symlink_to("/dev/null")
    for name, port in (("fake", "/dev/null"), ("renamed", "/dev/null"), ("linked", str(repository / "link"))):
        rig(repository, name, port)
        assert "in quarantine: it has lost steps" in dodo("rig", "status", "--wait", "0")[1]
    rig(repository, "other", "/dev/zero")
    assert "in quarantine" not in dodo("rig", "status", "--wait", "0")[1]
    rig(repository, "renamed")
    assert dodo("rig", "clear", "renamed")[0] == 0
    rig(repository)
    assert "in quarantine" not in dodo("rig", "status", "--wait", "0")[1]
    assert rigs_leases.all_quarantined() == {}


def test_no_variable_moves_the_quarantine_of_hardware(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    account = pwd.struct_passwd(("a", "x", os.getuid(), 0, "", str(repository / "account"), ""))
    monkeypatch.setattr(rigs_leases, "_SOFTWARE", set())  # the null device counts as hardware
    monkeypatch.setattr(pwd, "getpwuid", lambda _: account)
    rigs_leases.quarantine("fake", "it has lost steps", ["/dev/null"])
    assert list((repository / "account" / ".local" / "state" / "dodo" / "rigs").glob("device-*.json"))
    for name in ("DODO_RIGS", "XDG_STATE_HOME", "HOME"):
        monkeypatch.setenv(name, str(repository / "empty"))
    assert rigs_leases.quarantined("renamed", ["/dev/null"]) == "it has lost steps"
    assert rigs_leases.all_quarantined() == {"fake": "it has lost steps"}
    assert rigs_leases.clear_quarantine("renamed", ["/dev/null"])
    assert rigs_leases.all_quarantined() == {}


# The operator


@pytest.fixture
def rules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Writes the operator's file."""

    def write(**about: object) -> None:
        path = tmp_path / "rigs.yml"
        path.write_text(json.dumps({"dodo": 1, **about}))
        path.chmod(0o644)
        monkeypatch.setattr(operator, "FILE", path)

    return write


def permitted(folder: Path, axes: object = None, **limits: str) -> dict[str, object]:
    about = {"devices": ["/dev/null"], "repositories": [str(folder)], "limits": limits}
    return {"ours": {**about, **({"axes": axes} if axes else {})}}


MOTIONS = (("goto", "fake", "0", "0", "0"), ("home", "fake"), ("calibrate", "fake"))
TURNS, STEPS = {"x": "1 m", "yaw": "90 deg"}, {"x": {"steps": "3500 steps/m"}}


@pytest.mark.parametrize("words", MOTIONS, ids=lambda words: words[0])
@pytest.mark.parametrize(
    ("about", "operator_s", "said"),
    [
        ({"serial": "/dev/zero"}, {}, "'/dev/zero' is not a device of a rig in"),
        ({"limits": {"x": "1.5 m"}}, TURNS, "limits.x is 1.5 m, and"),
        ({"limits": {}}, TURNS, "limits.x is not set, and"),
        ({"limits": {"x": "1 m", "yaw": "91 deg"}}, TURNS, "limits.yaw is 91 deg, and"),
        ({"limits": {"x": "100 cm", "yaw": "90 deg"}}, TURNS, ""),
        ({"limits": {"x": "1 m"}}, {"x": "1 m"}, ""),
        ({"limits": {"x": "1 m"}, "axes": STEPS}, {"x": "1 m"}, "limits.x is 1.05422 m by the operator's constants"),
        ({"limits": {"x": "1 m"}, "axes": STEPS}, {"x": "1 m", "axes": STEPS}, ""),
        ({"limits": {"x": "1 m"}}, {"x": "1 m", "axes": {"x": {"steps": "3200 steps/m"}}}, "limits.x is 1.0375 m by"),
        (
            {"limits": {"yaw": "90 deg"}, "axes": {"yaw": {"offset": "80 steps"}}},
            {"yaw": "90 deg"},
            "yaw is 95.4545 deg",
        ),
        (
            {"limits": {"speed": "0.5 m/s"}},
            {"speed": "0.5 m/s", "axes": {"y": {"steps": "3200 steps/m"}}},
            "limits.speed is 0.51875 m/s by the operator's",
        ),
    ],
)
def test_a_repository_takes_a_rig_no_farther_than_its_operator_says(
    repository: Path, rules: Callable[..., None], words: tuple[str, ...], about: Any, operator_s: Any, said: str
) -> None:
    """By its port, by its limits, or by constants by which a step is farther."""
    fake = {"kind": "dynamic", "cid": 121, "serial": "/dev/null", **about}
    (repository / "dodo.yml").write_text(json.dumps({"dodo": 1, "rigs": {"fake": fake}}))
    rules(rigs=permitted(repository, **operator_s))
    code, output = dodo("rig", *words)
    assert (code, said in output) == (2, True) if said else "limits." not in output, output


@pytest.mark.parametrize("words", [*MOTIONS, ("clear", "fake")], ids=lambda words: words[0])
def test_only_permitted_repositories_use_a_rig(
    repository: Path, rules: Callable[..., None], words: tuple[str, ...]
) -> None:
    rig(repository)
    rules(rigs=permitted(repository / "other"))
    code, output = dodo("rig", *words)
    assert (code, "may not use rig 'ours': it is not in" in output) == (2, True), output
    rules(rigs=permitted(repository))
    assert "may not use" not in dodo("rig", *words)[1]


def test_places_come_from_the_operator_and_not_from_variables(
    repository: Path, rules: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    places = {"leases": str(repository / "locks"), "quarantine": str(repository / "bad")}
    rules(rigs=permitted(repository), **places)
    rigs_leases.quarantine("fake", "it has lost steps", ["/dev/null"])
    monkeypatch.setenv("DODO_RIGS", str(repository / "empty"))
    monkeypatch.setenv("DODO_LEASES", str(repository / "mine"))
    monkeypatch.setenv("XDG_STATE_HOME", str(repository / "home"))
    assert rigs_leases.quarantined("renamed", ["/dev/null"]) == "it has lost steps"
    lease = leases.try_lease("cid-121", {})
    assert lease is not None and lease.record.parent == repository / "locks"
    lease.release()
    assert not (repository / "mine").exists() and not (repository / "empty").exists()


@pytest.mark.parametrize(
    ("text", "mode", "said"),
    [
        ("dodo: 1\n", 0o666, "expected a file of root that only root can write"),
        ("dodo: 1\n", 0o664, "expected a file of root that only root can write"),
        ("", 0o644, "is empty"),
        ("dodo: 2\n", 0o644, "expected 1"),
        ("dodo: 1\nrigs: {a: {}}\n", 0o644, "has no key 'devices'"),
        ("dodo: 1\nrigs: {a: {devices: [/dev/null], limits: {x: 1_0 m}}}\n", 0o644, "not a quantity"),
        (
            "dodo: 1\nrigs: {a: {devices: [/dev/null], limits: {x: 1, z: 1 m}}}\n",
            0o644,
            r"rigs\.yml:2:\d+: 'x': '1' has no unit, expected a length in m; write for example '1 m'$",
        ),
        ("dodo: 1\nrigs: {a: {devices: [/dev/null], repositories: [tests]}}\n", 0o644, "absolute path"),
        ("dodo: 1\nleases: here\n", 0o644, "an absolute path"),
        ("dodo: [\n", 0o644, "not YAML"),
        ("\xff", 0o644, "cannot be read"),
    ],
)
def test_a_file_of_the_operator_that_cannot_be_used_stops_everything(
    repository: Path, monkeypatch: pytest.MonkeyPatch, text: str, mode: int, said: str
) -> None:
    path = repository / "rigs.yml"
    path.write_bytes(text.encode("latin-1"))
    path.chmod(mode)
    monkeypatch.setattr(operator, "FILE", path)
    with pytest.raises(MachineError, match=said):
        machine()
    with pytest.raises(RigProblem, match=r"rigs\.yml"):
        permission.refuse_forbidden([], {}, [repository])
    rig(repository)
    code, output = dodo("rig", "home", "fake")
    assert code in (2, 3) and "Traceback" not in output and "internal error" not in output


@pytest.mark.parametrize("rig_name", ["", "emulated"])
@pytest.mark.parametrize("port", ["/dev/ttyACM0", "socket://127.0.0.1:4242"])
@pytest.mark.thorough
def test_a_compiled_test_moves_no_hardware_without_a_rig(tmp_path: Path, rig_name: str, port: str) -> None:
    plan = Bench(tmp_path).plan()
    moves = PlannedService("action", "pose", "gantry", "x", ("python",), (Flag("serial", port),))
    for isolation in (None, "host"):
        bench = Bench(tmp_path, isolation)
        (outcome,) = bench.run(replace(plan, rig=rig_name, services=(*plan.services, moves)))
        words = f"service 'pose' would move what is at '{port}', and the test runs on no rig"
        assert (outcome.outcome, outcome.reason) == ("error", words)


# Masters


@pytest.mark.realtime
def test_a_rig_whose_command_is_killed_stops(place: Place) -> None:
    """A rig stops when the command that moves it is killed."""
    place.rig.status = 2
    process = place.start("rig", "goto", "fake", "0.5", "0", "0")
    while not place.rig.commands("GOTO"):
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    end = time.monotonic() + 10
    while place.rig.last() != "STOP":
        assert time.monotonic() < end, "the rig goes on"
        time.sleep(0.02)
    place.rig.status = 0
    assert "fake: the rig is idle" in place.dodo("rig", "status", "--wait", "10", code=0)
