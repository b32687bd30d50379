"""Ports with hardware, and those with a program."""

import os
from pathlib import Path

from dodo_dsl.spec.rig import is_simulated


def test_a_pseudo_terminal_has_a_program_at_its_other_end(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    link = tmp_path / "port"
    link.symlink_to(os.ttyname(theirs))
    assert is_simulated(str(link)) and is_simulated(os.ttyname(theirs)) and is_simulated("emulated")
    os.close(ours)
    os.close(theirs)


def test_serial_ports_have_hardware(tmp_path: Path) -> None:
    link = tmp_path / "port"
    link.symlink_to("/dev/ttyACM0")
    assert not any(map(is_simulated, ("/dev/ttyACM0", str(link), "socket://rig:2000", "/dev/pts/../ttyACM0", "")))
