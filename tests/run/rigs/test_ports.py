"""Which device files of rigs a program of a test must not see."""

import os
import pty
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.plan.model import Flag, Plan, PlannedService
from dodo_dsl.run.rigs import ports
from dodo_dsl.run.rigs.problems import RigProblem
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
    tested = on_rig(rig, known=(rig, other, "/dev/ttyACM99"))
    (pose,) = tested.services
    assert ports.masked(tested, None) == [os.path.realpath(rig), os.path.realpath(other)]
    assert ports.masked(tested, pose) == [os.path.realpath(other)]
    assert ports.masked(tested, replace(pose, port="")) == ports.masked(tested, None)


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
    monkeypatch.setattr(ports, "_SYS", tmp_path)
    monkeypatch.setattr(ports, "_USB", tmp_path)
    assert ports.device_files([str(terminals[0])]) == [os.path.realpath(terminals[0]), str(usb)]


def test_no_other_service_opens_the_port_under_any_name(terminals: list[Path]) -> None:
    rig, other = terminals

    def camera(source: str) -> PlannedService:
        return PlannedService("environment", "eye", "camera", "x", (), (Flag("source", source),))

    ports.refuse_shared_port(on_rig(str(rig), camera(str(other)), camera("rpicam")))
    text = f"'eye' would open '{rig.resolve()}', the port of the rig, which only 'pose' may open"
    with pytest.raises(RigProblem, match=text):
        ports.refuse_shared_port(on_rig(str(rig), camera(str(rig.resolve()))))
