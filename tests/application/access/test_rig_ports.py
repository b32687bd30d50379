"""Ports of rigs in compose files, under all their names."""

import os
import pty
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.application.access.host_paths import holds_port, is_port, is_rule_for_port, source

PORTS = ("/dev/ttyACM7", "socket://127.0.0.1:4242")


@pytest.fixture
def terminal() -> Iterator[str]:
    """The device file of a pseudo terminal."""
    master, slave = pty.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize(
    ("device", "port", "folder"),
    [
        ("/dev/ttyACM7", True, True),
        ("/dev//x/../ttyACM7", True, True),
        ("/dev/serial/by-id/usb-Arduino-if00", True, True),
        ("/dev/bus/usb/001/004", True, True),
        ("/dev", False, True),
        ("/", False, True),
        ("/dev/ttyACM70", False, False),
        ("/dev/video0", False, False),
        ("/dev/bus/pci", False, False),
    ],
)
def test_what_leads_to_a_port(device: str, port: bool, folder: bool) -> None:
    assert (is_port(device, PORTS), holds_port(device, PORTS)) == (port, folder)
    assert not holds_port(device, ()), "no rig, no port"


def test_a_link_is_the_port_that_it_leads_to(tmp_path: Path, terminal: str) -> None:
    link = tmp_path / "rig"
    link.symlink_to(terminal)
    assert is_port(str(link), [terminal])
    assert is_port(terminal, [str(link)])


@pytest.mark.parametrize(
    ("rule", "leads"),
    [
        ("c 166:* rwm", True),
        ("c 188:0 rw", True),
        ("c *:* r", True),
        ("a *:* rwm", True),
        ("c 81:* rwm", False),
        ("c 226:0 rw", False),
        ("${RULE}", False),
    ],
)
def test_rules_of_devices(rule: str, leads: bool) -> None:
    assert is_rule_for_port(rule, PORTS) is leads
    assert not is_rule_for_port(rule, ())


def test_a_rule_of_a_port_that_is_there(terminal: str) -> None:
    number = Path(terminal).stat().st_rdev
    major, minor = os.major(number), os.minor(number)
    words = (f"c {major}:{minor} rw", f"c {major}:* rw", f"c {major}:{minor + 1} rw")
    assert [is_rule_for_port(word, [terminal]) for word in words] == [True, True, False]


def test_the_host_s_path_of_both_forms() -> None:
    assert [source(word) for word in ("/dev/a:/dev/b:rw", {"source": "/dev/a"}, "/dev/a", None)] == ["/dev/a"] * 3 + [
        ""
    ]
