"""Programs of a test on the host open the port of its rig, as root and as an ordinary user."""

import os
import pty
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.hostile.command import USERS, told_by

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ports")]


@pytest.fixture(scope="module", params=USERS)
def told(request: pytest.FixtureRequest) -> Iterator[dict[str, Any]]:
    """What the programs of one test reached. The port is a pseudo terminal that everybody may open."""
    master, slave = pty.openpty()
    os.chmod(os.ttyname(slave), 0o666)  # noqa: PTH101
    with tempfile.TemporaryDirectory(prefix="dodo-hostile-") as name:
        port = Path(name, "port")
        port.symlink_to(os.ttyname(slave))
        yield told_by(request.param, "tests.hostile.reach_port", Path(name), str(port))
    os.close(master)
    os.close(slave)


def test_the_application_does_not_reach_it(told: dict[str, Any]) -> None:
    """The application opens the rig's port in no way, while the test goes on as if it had not tried."""
    assert (told["outcome"], told["reason"]) == ("passed", "it drove")
    assert told["reached"]["app"] == []


@pytest.mark.parametrize("service", ["camera", "judge"])
def test_other_services_do_not_have_it(told: dict[str, Any], service: str) -> None:
    """Services that do not move the rig find another device in the place of its port."""
    assert not {"its link", "its file"} & set(told["reached"][service])


def test_the_service_that_moves_the_rig_has_it(told: dict[str, Any]) -> None:
    """Control: the service that moves the rig opens its port."""
    assert {"its link", "its file"} <= set(told["reached"]["mover"])
