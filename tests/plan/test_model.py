"""Plans: layers, variables and devices."""

from dataclasses import replace

import pytest

from dodo_dsl.plan.model import Lockstep, is_device
from tests.plan.plans import BASE


def test_services_of_a_layer() -> None:
    assert [service.name for service in BASE.layer("evaluation")] == ["track-camera"]
    assert BASE.layer("action") == ()


def test_variables_of_services() -> None:
    assert BASE.variables == {}
    stepped = replace(BASE, clock="lockstep", lockstep=Lockstep(2, 60.0))
    assert stepped.variables == {"DODO_CLOCK": "lockstep", "DODO_READERS": "2"}
    assert replace(BASE, rig="kiwi").variables == {"DODO_RIG": "kiwi"}


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/dev/video0", True),
        ("/dev/serial/by-id/usb-x_1.2:3", True),
        ("/dev", False),
        ("/dev/", False),
        ("/dev/..", False),
        ("/dev/../etc/passwd", False),
        ("/dev/a/./b", False),
        ("/dev/a b", False),
        ("rpicam", False),
    ],
)
def test_device_files(path: str, expected: bool) -> None:
    assert is_device(path) is expected
