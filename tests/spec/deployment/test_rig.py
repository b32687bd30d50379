"""Rigs, of hardware and emulated."""

import os
from pathlib import Path

import pytest

from dodo_dsl.source import Scalar
from dodo_dsl.spec.deployment.rig import EMULATED, EMULATED_FILE, Rig, emulated, is_simulated
from tests.source.nodes import mapping

KIWI = Rig("kiwi", "static", 121, mapping("kind: static\ncamera: {width: 640}\nprivileged: true\n"))


def test_hardware_and_the_emulated_rig() -> None:
    assert (KIWI.is_emulated, KIWI.tag, KIWI.isolation, KIWI.privileged) == (False, "hil-static", "host", True)
    rig = emulated()
    assert (rig.name, rig.cid) == (EMULATED, None)
    assert (rig.is_emulated, rig.tag, rig.isolation, rig.privileged) == (True, "sil", "network", False)


@pytest.mark.parametrize("key", ["", "camera.height", "kind.width", "camera.width.x", "other"])
def test_keys_that_a_rig_does_not_have(key: str) -> None:
    assert KIWI.entry(key) is None


def test_its_entries() -> None:
    entry = KIWI.entry("camera.width")
    assert entry is not None
    assert isinstance(entry.value, Scalar)
    assert entry.value.value == 640
    source = emulated().entry("camera.source")
    assert source is not None
    assert source.key.file == EMULATED_FILE


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
