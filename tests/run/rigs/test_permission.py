"""What moves a rig how far, and which device files of rigs a program of a test must not see."""

import math
import os
import pty
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.cli import rig_measure
from dodo_dsl.plan.model import Flag, Plan, PlannedService
from dodo_dsl.run.rigs import permission
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec import machine as operator
from dodo_dsl.spec.rig import LIMIT_UNITS
from services.gantry import memory, rig_table
from services.gantry.motion import FARTHEST_OFFSET
from tests.run.scripted import plan


@pytest.fixture
def terminals(tmp_path: Path) -> Iterator[list[Path]]:
    """Links to two pseudo terminals, in the place of the ports of rigs."""
    pairs = [pty.openpty(), pty.openpty()]
    links = [tmp_path / name for name in ("rig", "other")]
    for link, (_, slave) in zip(links, pairs, strict=True):
        link.symlink_to(os.ttyname(slave))
    yield links
    for number in (number for pair in pairs for number in pair):
        os.close(number)


def on_rig(port: str, *others: PlannedService, known: tuple[str, ...] = ()) -> Plan:
    pose = PlannedService("action", "pose", "gantry", "x", (), (Flag("serial", port),), port=port)
    tested = plan()
    application = replace(tested.application, access=replace(tested.application.access, ports=known))
    return replace(tested, rig="kiwi", services=(pose, *others), application=application)


def test_every_port_but_ones_own_is_masked(terminals: list[Path]) -> None:
    rig, other = map(str, terminals)
    tested = on_rig(rig, known=(rig, other, "socket://127.0.0.1:4242", "/dev/ttyACM99"))
    (pose,) = tested.services
    assert permission.masked(tested, None) == [os.path.realpath(rig), os.path.realpath(other)]
    assert permission.masked(tested, pose) == [os.path.realpath(other)]
    assert permission.masked(tested, replace(pose, port="")) == permission.masked(tested, None)


def test_the_usb_device_of_a_port_is_masked_too(
    terminals: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    number = terminals[0].stat().st_rdev
    device = tmp_path / "devices" / "usb1" / "1-2"
    (device / "1-2:1.0" / "tty" / "ttyACM0").mkdir(parents=True)
    (device / "busnum").write_text("1\n")
    (device / "devnum").write_text("12\n")
    (tmp_path / f"{os.major(number)}:{os.minor(number)}").symlink_to(device / "1-2:1.0" / "tty" / "ttyACM0")
    usb = tmp_path / "001" / "012"
    usb.parent.mkdir()
    usb.touch()
    monkeypatch.setattr(permission, "_SYS", tmp_path)
    monkeypatch.setattr(permission, "_USB", tmp_path)
    assert permission.device_files([str(terminals[0])]) == [os.path.realpath(terminals[0]), str(usb)]


def test_no_other_service_opens_the_port_under_any_name(terminals: list[Path]) -> None:
    rig, other = terminals

    def camera(source: str) -> PlannedService:
        return PlannedService("environment", "eye", "camera", "x", (), (Flag("source", source),))

    permission.refuse_shared_port(on_rig(str(rig), camera(str(other)), camera("rpicam")))
    text = f"'eye' would open '{rig.resolve()}', the port of the rig, which only 'pose' may open"
    with pytest.raises(RigProblem, match=text):
        permission.refuse_shared_port(on_rig(str(rig), camera(str(rig.resolve()))))
    with pytest.raises(RigProblem, match="which only 'pose' may open"):
        permission.refuse_shared_port(on_rig("socket://127.0.0.1:4242", camera("socket://localhost:4242")))


def test_where_the_operators_file_is_broken_nothing_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody knows then which ports to keep."""
    file = tmp_path / "rigs.yml"
    file.write_text("dodo: 1\nrigs: 3\n")
    file.chmod(0o644)
    monkeypatch.setattr(operator, "FILE", file)
    with pytest.raises(operator.MachineError):
        permission.masked(plan(), None)


def test_constants_are_those_of_the_firmware() -> None:
    steps = {f"steps-{axis}": value for axis, value in rig_table.STEPS.items()}
    assert {**steps, "offset-yaw": rig_table.OFFSETS["yaw"]} == permission.BUILT_IN
    assert permission.BUILT_IN_CIRCLE["steps-yaw"] == pytest.approx(rig_table.CIRCLE_STEPS / 360)
    assert permission.BUILT_IN_CIRCLE["offset-yaw"] == rig_table.CIRCLE_OFFSET


def test_offsets_that_are_measured_are_those_that_the_gantry_takes() -> None:
    middles = rig_table.OFFSETS["yaw"], rig_table.CIRCLE_OFFSET
    assert tuple((m - FARTHEST_OFFSET, m + FARTHEST_OFFSET) for m in middles) == rig_measure.OFFSETS


def test_limits_have_the_names_and_units_of_the_gantry() -> None:
    assert list(LIMIT_UNITS.items()) == list(memory.UNITS.items())


@pytest.mark.parametrize("value", ["nan", "inf", "fast", ""])
def test_what_is_no_number_bounds_nothing(value: str) -> None:
    """A compiled file is only a file; the operator's limits refuse what is unlimited."""
    kept = f"speed={value}"
    assert permission.motion_of({"max-speed": value, "limits": "speed=0.2"}).limits["speed"] == math.inf
    assert permission.motion_of({"max-speed": "0.2", "limits": kept}).limits["speed"] == math.inf
    longer = permission.motion_of({"range-x": "0.5", "limits": "x=0.5", "steps-x": value})
    assert longer.by({})["x"] == math.inf
    whole = permission.motion_of({"max-speed": "0.2", "limits": "speed=0.2"})
    assert whole.limits["speed"] == 0.2
